// Pairs of bodies moved by setTransform(), with each OctreeSettings::bounds. Lengths are in mm.
#include "Rows.h"

#include "InstrumentArm.h"
#include "Meshes.h"
#include "Scenes.h"

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>

namespace palpate::benchmark {
namespace {

using Eigen::Matrix3d, Eigen::Vector3d, std::numbers::pi;
using scenes::SceneMesh;

struct Placement {
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
};

struct Scene {
  std::string name;
  std::vector<SceneMesh> bodies;
  std::vector<std::pair<std::size_t, std::size_t>> pairs{{0, 1}};
  /// Where a body is at a phase of the motion, which is periodic in 2 pi.
  std::function<Placement(std::size_t body, double phase)> place;
  int frames = 20;
  double thickness = 0.25;
  bool deforms = false;  ///< the first body's positions change in each frame
};

Matrix3d turn(double angle, const Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

/// A closed body about the z axis, from -length / 2 to length / 2. radius(u): u in [0, 1] along it.
template <class Radius>
SceneMesh lathe(int along, int around, double length, double bump, Radius&& radius) {
  SceneMesh mesh = scenes::tube(around, along);
  for (Vector3d& p : mesh.positions) {
    const double u = 0.5 * (1 - p[2]), phi = std::atan2(p[1], p[0]),
                 end = std::sqrt(std::max(0.0, 1 - std::pow(p[2], 20))),
                 r = radius(u) * end * (1 + bump * std::sin(3 * phi + 40 * u) * std::cos(31 * u));
    p = {r * std::cos(phi), r * std::sin(phi), 0.5 * length * p[2]};
  }
  return mesh;
}
SceneMesh rod() {
  return lathe(400, 32, 200, 0.02, [](double) { return 8.0; });
}
double boneRadius(double u) {
  return 13 + 15 * std::exp(-std::pow((u - 0.04) / 0.08, 2)) +
         17 * std::exp(-std::pow((u - 0.95) / 0.09, 2));
}
SceneMesh bone() { return lathe(500, 100, 400, 0.04, boneRadius); }

SceneMesh turned(SceneMesh mesh, const Matrix3d& rotation) {
  for (Vector3d& p : mesh.positions) p = rotation * p;
  return mesh;
}

/// No axis and no diagonal of this frame is near the z axis of a body.
Matrix3d genericFrame() { return turn(0.9, {1, 2, 0.5}) * turn(0.4, Vector3d::UnitX()); }

/// The second body moves beside the first one, which stays. Both are seen from the side. frame: of
/// the positions that the library gets.
Scene besideEachOther(std::string name, const SceneMesh& a, const SceneMesh& b,
                      const Matrix3d& frame, std::function<Placement(double)> relative) {
  const Matrix3d world = turn(1.1, {3, 1, 2});
  return {std::move(name),
          {turned(a, frame), turned(b, frame)},
          {{0, 1}},
          [=](std::size_t body, double phase) {
            const Placement at = body == 0 ? Placement() : relative(phase);
            return Placement{world * at.rotation * frame.transpose(), world * at.translation};
          }};
}

std::string gapName(const std::string& name, double gap) {
  return name + ", gap " + std::to_string(static_cast<int>(gap));
}

Scene rods(const std::string& name, const Matrix3d& frame, double crossing, double gap) {
  return besideEachOther(gapName(name, gap), rod(), rod(), frame, [=](double phase) {
    return Placement{turn(crossing + 0.01 * std::sin(phase), Vector3d::UnitX()) *
                         turn(0.1 * std::cos(phase), Vector3d::UnitZ()),
                     {16 + gap, 0, 2 * std::sin(phase)}};
  });
}

Scene bones(double gap) {
  return besideEachOther(gapName("bones side by side", gap), bone(), bone(), genericFrame(),
                         [=](double phase) {
                           return Placement{turn(pi + 0.01 * std::sin(phase), Vector3d::UnitX()) *
                                                turn(0.1 * std::cos(phase), Vector3d::UnitZ()),
                                            {53.5 + gap, 0, 2 * std::sin(phase)}};
                         });
}

Scene nailInTube() {
  SceneMesh tube = scenes::tube(60, 500), outer = tube;
  for (Vector3d& p : tube.positions) p = {8 * p[0], 8 * p[1], 150 * p[2]};
  for (Vector3d& p : outer.positions) p = {14 * p[0], 14 * p[1], 150 * p[2]};
  scenes::append(tube, outer);
  const SceneMesh nail = lathe(500, 48, 320, 0.0, [](double) { return 6.0; });
  return besideEachOther("nail in a tube", nail, tube, genericFrame(), [](double phase) {
    return Placement{turn(0.1 * std::sin(phase), Vector3d::UnitZ()),
                     {2 * std::cos(phase), 2 * std::sin(phase), 2 * std::sin(phase)}};
  });
}

Scene ballInBowl() {
  SceneMesh ball = scenes::sphere(40), bowl;
  for (const double radius : {26.0, 30.0}) {
    SceneMesh half = scenes::sphere(40);
    std::erase_if(half.triangles, [&](const Triangle& t) {
      return half.positions[t[0]][2] + half.positions[t[1]][2] + half.positions[t[2]][2] > 0.3;
    });
    for (Vector3d& p : half.positions) p *= radius;
    scenes::append(bowl, half);
  }
  for (Vector3d& p : ball.positions) p *= 25.0;
  return besideEachOther("ball in a bowl", bowl, ball, Matrix3d::Identity(), [](double phase) {
    return Placement{turn(0.1 * std::sin(phase), {1, 2, 3}), {0.1 * std::cos(phase), 0, -0.95}};
  });
}

/// A tool whose tip follows a helix about a bone, forth and back.
Scene toolOnPath(double gap) {
  const SceneMesh tool =
      lathe(200, 20, 150, 0.0, [](double u) { return u < 0.8 ? 4.0 : 1 + 15 * (1 - u); });
  Scene scene = besideEachOther(
      gapName("tool on a path past a bone", gap), bone(), tool, genericFrame(), [=](double phase) {
        const double u = 0.5 + 0.1 * std::sin(phase), phi = 12 * u, r = boneRadius(u) + gap;
        const Vector3d out(std::cos(phi), std::sin(phi), 0),
            axis = std::cos(1.22) * out + std::sin(1.22) * Vector3d::UnitZ(),
            tip = r * out + Vector3d(0, 0, -400 * (u - 0.5));
        return Placement{
            Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix(),
            tip + 75 * axis};
      });
  scene.frames = 100;
  return scene;
}

/// Ten links of two arms with each other and with three organs, all rigid.
Scene robotArms() {
  constexpr std::size_t kOrgans = 3, kLinks = scenes::InstrumentArm::kLinks;
  Scene scene;
  scene.name = "links of RobotArms";
  scene.thickness = 2;
  const std::array<Vector3d, kOrgans> places{{{-44, 16, -14}, {38, 16, -22}, {0, -30, -30}}};
  for (std::size_t i = 0; i < kOrgans; ++i) {
    scene.bodies.push_back(scenes::organs().meshes[i]);
    for (Vector3d& p : scene.bodies.back().positions)
      p = (34.0 - 4.0 * static_cast<double>(i)) * p + places[i];
  }
  for (int arm = 0; arm < 2; ++arm)
    for (const auto& link : scenes::InstrumentArm::makeLinks()) scene.bodies.push_back(link.drawn);
  scene.pairs.clear();
  for (std::size_t a = kOrgans; a < scene.bodies.size(); ++a)
    for (std::size_t b = 0; b < (a < kOrgans + kLinks ? kOrgans : kOrgans + kLinks); ++b)
      scene.pairs.push_back({a, b});
  scene.place = [](std::size_t body, double phase) {
    if (body < kOrgans)
      return Placement{turn(0.06 * std::sin(phase + static_cast<double>(body)), Vector3d::UnitY()),
                       {0, 0, 3 * std::sin(phase)}};
    const double side = body < kOrgans + kLinks ? -1 : 1;
    Eigen::Isometry3d port = Eigen::Isometry3d::Identity();
    port.translation() = Vector3d(58 * side, -25, 60);
    const Vector3d in = (Vector3d(-14 * side, 6, -16) - port.translation()).normalized();
    port.linear() = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), in).toRotationMatrix();
    const double s = std::sin(phase), c = std::cos(phase), twice = std::sin(2 * phase + side);
    const scenes::InstrumentArm arm(
        port, (scenes::InstrumentArm::Joints() << 0.35 * s, 0.35 * side * c, 42 + 20 * twice,
               0.8 * c - 0.3, 0.7 * s * side, 0.25 - 0.35 * twice)
                  .finished());
    const auto& link = arm.link(static_cast<int>((body - kOrgans) % kLinks));
    return Placement{link.linear(), link.translation()};
  };
  return scene;
}

/// A bone that lies on a sheet of tissue.
Scene boneOnTissue() {
  SceneMesh sheet = scenes::sheet(70);
  for (Vector3d& p : sheet.positions) p = {100 * p[0], 100 * p[1], 0};
  Scene scene = besideEachOther(
      "bone on deforming tissue", sheet, bone(), Matrix3d::Identity(), [](double phase) {
        return Placement{turn(pi / 2, Vector3d::UnitX()), {0, 100, 18 + std::sin(phase)}};
      });
  scene.deforms = true;
  return scene;
}

/// One object for each kind of bounds.
class BoundsRun {
 public:
  BoundsRun(const Scene& scene, Method method, OctreeBounds bounds) : m_scene(scene) {
    Settings settings;
    settings.threads = 1;
    settings.octree.bounds = bounds;
    m_detection = std::make_unique<OctreeBasedCD>(settings);
    for (const SceneMesh& body : scene.bodies)
      m_ids.push_back(m_detection->addTriangleMesh(body.positions, body.triangles));
    for (const auto& [a, b] : scene.pairs)
      m_detection->addCollisionPair(m_ids[a], m_ids[b], {method, scene.thickness});
  }
  /// Microseconds of one frame.
  double frame(double phase) {
    if (m_scene.deforms) {
      m_positions = m_scene.bodies[0].positions;
      for (Vector3d& p : m_positions) p[2] += std::sin(0.1 * p[0] + phase);
    }
    const double begin = now();
    for (std::size_t body = 0; body < m_ids.size(); ++body) {
      if (m_scene.deforms && body == 0) {
        m_detection->setPositions(m_ids[0], m_positions);
      } else {
        const Placement at = m_scene.place(body, phase);
        m_detection->setTransform(m_ids[body], {at.rotation, at.translation});
      }
    }
    m_detection->detectCollision();
    const double elapsed = 1000 * (now() - begin);
    m_hash = 0;
    for (const auto& [a, b] : m_scene.pairs)
      m_hash = 31 * m_hash + m_detection->collisionData(m_ids[a], m_ids[b]).hash();
    m_contacts = m_detection->statistics().contacts;
    m_detection->advance();
    return elapsed;
  }
  std::uint64_t hash() const { return m_hash; }  ///< of the last frame's contacts
  std::size_t contacts() const { return m_contacts; }
  std::size_t bytes() const { return m_detection->octree().statistics().bytes; }

 private:
  const Scene& m_scene;
  std::unique_ptr<OctreeBasedCD> m_detection;
  std::vector<GeometryId> m_ids;
  std::vector<Vector3d> m_positions;
  std::uint64_t m_hash = 0;
  std::size_t m_contacts = 0;
};

constexpr const char* kNames[] = {"Box", "Dop14", "Dop18"};

void boundsRow(Report& report, const RowOptions& options, const Scene& scene, const char* name,
               Method method) {
  std::vector<BoundsRun> runs;
  for (const OctreeBounds bounds : {OctreeBounds::Box, OctreeBounds::Dop14, OctreeBounds::Dop18})
    runs.emplace_back(scene, method, bounds);
  std::vector<double> times[3], ratios[3];
  std::size_t contacts = 0, differing = 0;
  std::uint64_t hash = 0;
  // The first repetition builds the octrees. The bounds take turns in each frame.
  for (int repetition = 0; repetition <= options.measure.repetitions; ++repetition) {
    double sums[3] = {};
    for (int frame = 0; frame < scene.frames; ++frame) {
      for (int i = 0; i < 3; ++i) {
        const int bounds = (i + frame + repetition) % 3;
        sums[bounds] += runs[bounds].frame(2 * pi * frame / scene.frames) / scene.frames;
      }
      for (const BoundsRun& run : runs) differing += run.hash() != runs[0].hash();
      if (repetition > 0) continue;
      contacts += runs[0].contacts();
      hash = 31 * hash + runs[0].hash();
    }
    for (int i = 0; i < 3 && repetition > 0; ++i) {
      times[i].push_back(sums[i]);
      ratios[i].push_back(sums[i] / sums[0]);
    }
  }
  std::vector<std::string> line{scene.name + ", " + name,
                                std::to_string(contacts / static_cast<std::size_t>(scene.frames))};
  const auto row = [&](const std::string& metric, double value) {
    report.row("bounds", scene.name, 1, name, metric, value, hash);
  };
  row("contacts", static_cast<double>(contacts) / scene.frames);
  row("Box us", median(times[0]));
  line.push_back(milliseconds(median(times[0])));
  for (int i = 1; i < 3; ++i) {
    row(kNames[i] + std::string(" / Box"), median(ratios[i]));
    line.push_back(benchmark::times(median(ratios[i])));
  }
  for (int i = 0; i < 3; ++i) {
    const double megabytes = 1e-6 * static_cast<double>(runs[i].bytes());
    row(kNames[i] + std::string(" MB"), megabytes);
    line.push_back(milliseconds(megabytes));
  }
  line.push_back(differing == 0 ? "equal" : std::to_string(differing) + " DIFFER");
  report.line(line);
}

}  // namespace

void boundsRows(Report& report, const RowOptions& options) {
  report.heading("Bounds of placed bodies: microseconds of detectCollision() and setTransform()");
  report.line(
      {"", "contacts", "Box us", "Dop14", "Dop18", "Box MB", "Dop14 MB", "Dop18 MB", "contacts"});
  const Matrix3d generic = genericFrame(), aligned = Matrix3d::Identity();
  std::vector<std::function<Scene()>> all;
  for (const double gap : {0.0, 1.0, 16.0}) {
    all.push_back([=] { return rods("rods side by side", generic, 0, gap); });
    all.push_back([=] { return rods("rods crossing", generic, pi / 3, gap); });
    all.push_back([=] { return rods("aligned rods side by side", aligned, 0, gap); });
  }
  for (const double gap : {0.0, 4.0, 16.0}) all.push_back([=] { return bones(gap); });
  all.push_back(nailInTube);
  all.push_back(ballInBowl);
  for (const double gap : {0.0, 4.0, 16.0}) all.push_back([=] { return toolOnPath(gap); });
  all.push_back(robotArms);
  all.push_back(boneOnTissue);
  for (const auto& make : all) {
    const Scene scene = make();
    if (!isWanted(scene.name, options.scenes)) continue;
    boundsRow(report, options, scene, "Proximity", Method::Proximity);
    boundsRow(report, options, scene, "Auto", Method::Auto);
  }
}

}  // namespace palpate::benchmark
