// Particles near a placed bone, by Method::Proxy, by Method::DistanceField and by
// Method::Proximity in turns. All move. The time is that of whole frames: from positions and a
// transform to contacts.
#include "Bone.h"
#include "Rows.h"

#include "Common/RandomMeshes.h"

#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <memory>
#include <span>
#include <string>

namespace palpate::benchmark {
namespace {

constexpr int kFrames = 12;
constexpr std::size_t kParticles = 1000000;
constexpr double kRadius = 0.001, kThickness = 0.001, kAllowedError = 1e-4, kLooseError = 2.5e-4;

struct Placement {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};

Placement placement(int frame) {
  const double angle = 0.01 * frame;
  return {Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
          {0.5 + 0.1 * std::sin(angle), 0.5, 0.42}};
}

/// Particles in front of random triangles, up to twice the contact distance away, in the body's
/// frame and in random order.
std::vector<Eigen::Vector3d> particlesAt(const testing::Mesh& body, std::size_t count) {
  testing::Random random(1);
  std::vector<Eigen::Vector3d> points(count);
  for (Eigen::Vector3d& p : points) {
    const auto& [i, j, k] = body.triangles[random() % body.triangles.size()];
    const Eigen::Vector3d &a = body.positions[i], u = body.positions[j] - a,
                          v = body.positions[k] - a;
    const double s = testing::uniform(random, 0, 1), t = testing::uniform(random, 0, 1 - s);
    p = a + s * u + t * v +
        testing::uniform(random, 0, 2) * (kRadius + kThickness) * u.cross(v).normalized();
  }
  return points;
}

struct Run {
  Run(const testing::Mesh& mesh, const std::vector<Eigen::Vector3d>& points,
      const PairSettings& pair, int threads, std::shared_ptr<const DistanceField> field = {})
      : detection(Settings{.threads = threads}),
        smoke(detection.addPointSet(points, kRadius)),
        body(detection.addTriangleMesh(mesh.positions, mesh.triangles)) {
    if (field) detection.attachDistanceField(body, std::move(field));
    detection.addCollisionPair(smoke, body, pair);
  }

  void step(const std::vector<Eigen::Vector3d>& world, const Placement& at, bool isCounted) {
    const double begin = now();
    detection.setPositions(smoke, world);
    detection.setTransform(body, {at.rotation, at.translation});
    detection.detectCollision();
    detection.advance();
    (isCounted ? samples : first).push_back(now() - begin);
  }
  const CollisionData& data() const { return detection.collisionData(smoke, body); }

  OctreeBasedCD detection;
  GeometryId smoke, body;
  std::vector<double> samples, first;
};

/// A frame of all runs, in turns. The points are in the body's frame and move a little.
void stepAll(std::span<Run* const> runs, const std::vector<Eigen::Vector3d>& points,
             std::vector<Eigen::Vector3d>& world, int frame) {
  const Placement at = placement(frame);
  for (std::size_t i = 0; i < points.size(); ++i)
    world[i] = at.rotation * (1.0 + 1e-4 * (frame % 5)) * points[i] + at.translation;
  for (Run* run : runs) run->step(world, at, frame > 2);
}

/// Exact, by a field and by a proxy, for numbers of particles and triangles.
void sizeRows(Report& report) {
  report.line({"one thread", "build", "frame", "contacts"});
  for (const std::uint32_t rings : {71u, 224u, 501u}) {
    const testing::Mesh body = bone(rings, rings + 1);
    const double begin = now();
    const auto field = std::make_shared<const DistanceField>(
        DistanceField::build({body.positions, body.triangles},
                             {.errorBound = kLooseError, .band = 5 * kThickness, .threads = 1}));
    const double fieldBuild = now() - begin;
    for (const std::size_t count : {1000u, 10000u, 100000u}) {
      const std::vector<Eigen::Vector3d> points = particlesAt(body, count);
      std::vector<Eigen::Vector3d> world = points;
      Run exact(body, points, {.method = Method::Proximity, .thickness = kThickness}, 1),
          byField(body, points, {.method = Method::DistanceField, .thickness = kThickness}, 1,
                  field),
          proxy(body, points,
                {.method = Method::Proxy, .thickness = kThickness, .allowedError = kLooseError}, 1);
      const std::array<Run*, 3> runs{&exact, &byField, &proxy};
      for (int frame = 0; frame < kFrames; ++frame) stepAll(runs, points, world, frame);
      const std::string scene =
          std::to_string(count) + " of " + std::to_string(body.triangles.size()) + " triangles";
      report.line({scene});
      for (const auto& [run, name] :
           {std::pair{&exact, "Proximity"}, {&byField, "DistanceField"}, {&proxy, "Proxy"}}) {
        const double build = run->first.front() + (run == &byField ? fieldBuild : 0.0);
        report.line({std::string("  ") + name, milliseconds(build),
                     milliseconds(median(run->samples)),
                     std::to_string(run->detection.statistics().contacts)});
        report.row("particles", scene, 1, name, "build ms", build);
        report.row("particles", scene, 1, name, "frame ms", median(run->samples));
      }
    }
  }
}

}  // namespace

void proxyRows(Report& report, const RowOptions& options) {
  if (!options.scenes.empty() && isWanted("sizes", options.scenes)) return sizeRows(report);
  report.heading("A million particles near a bone of 502,000 triangles: ms per frame");
  report.line({"", "frame", "worst", "first frame", "ns each and thread", "contacts"});
  const testing::Mesh body = bone();
  const std::vector<Eigen::Vector3d> points = particlesAt(body, kParticles);
  std::vector<Eigen::Vector3d> world = points;
  for (const int threads : options.threads) {
    Run proxy(body, points,
              {.method = Method::Proxy, .thickness = kThickness, .allowedError = kAllowedError},
              threads),
        proximity(body, points, {.method = Method::Proximity, .thickness = kThickness}, threads);
    const std::array<Run*, 2> runs{&proxy, &proximity};
    for (int frame = 0; frame < kFrames; ++frame) stepAll(runs, points, world, frame);
    const double each = 1e6 * threads / static_cast<double>(kParticles);
    for (const auto& [run, name] : {std::pair{&proxy, "Proxy"}, {&proximity, "Proximity"}}) {
      const double frame = median(run->samples);
      report.line({std::string(name) + ", " + std::to_string(threads) + " threads",
                   milliseconds(frame), milliseconds(quantile(run->samples, 1)),
                   milliseconds(run->first.front()), milliseconds(frame * each),
                   std::to_string(run->detection.statistics().contacts)});
      report.row("proxy", "particles-bone", threads, name, "frame ms", frame, run->data().hash());
      report.row("proxy", "particles-bone", threads, name, "ns per particle and thread",
                 frame * each);
    }
    const double ratio = median(proximity.samples) / median(proxy.samples);
    report.line({"Proximity over Proxy", times(ratio)});
    report.row("proxy", "particles-bone", threads, "Proximity over Proxy", "ratio", ratio);
    report.line(
        {"stated error, in thicknesses", milliseconds(proxy.data().errorBound() / kThickness)});
    report.row("proxy", "particles-bone", threads, "Proxy", "stated error in thicknesses",
               proxy.data().errorBound() / kThickness);
  }
}

}  // namespace palpate::benchmark
