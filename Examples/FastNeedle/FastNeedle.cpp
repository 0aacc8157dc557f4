// A needle at 20 thicknesses a frame, further than its own length, through three membranes side by
// side: Proximity misses it, Continuous and Auto do not.
#include "SceneProgram.h"

#include <Eigen/Geometry>

#include <array>
#include <cmath>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d;

// Lengths in mm, times in s.
constexpr double kFrame = 1.0 / 60, kThickness = 0.5, kSpeed = 20 * kThickness;
// Membranes reach into each other, but no pair of theirs is tested. Pictures show their middle.
constexpr double kSpacing = 15, kShown = 6.5;
constexpr double kHalfWidth = 15, kNeedleLength = 8, kNeedleRadius = 0.4;
constexpr double kAbove = 11, kBelow = -9;  // where the tip turns
constexpr int kRounds = 4, kIterations = 12, kFramesDown = 12, kPeriod = 24;

/// Open at its blunt end, tip at the origin, along z.
SceneMesh needleMesh() {
  SceneMesh mesh = tube(8, 8);
  for (Vector3d& p : mesh.positions) {
    const double height = (p.z() + 1) / 2 * kNeedleLength;
    const double radius = kNeedleRadius * std::min(1.0, 0.1 + height / 3);
    p = {radius * p.x(), radius * p.y(), height};
  }
  return mesh;
}

/// The triangles whose vertices are all kept. vertexOf: the old index of each vertex.
SceneMesh partOf(const SceneMesh& mesh, const std::function<bool(const Vector3d&)>& keeps,
                 std::vector<std::uint32_t>& vertexOf) {
  SceneMesh part;
  std::vector<std::uint32_t> newIndex(mesh.positions.size());
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    if (!keeps(mesh.positions[v])) continue;
    newIndex[v] = static_cast<std::uint32_t>(vertexOf.size());
    vertexOf.push_back(v);
    part.positions.push_back(mesh.positions[v]);
  }
  for (const auto& [a, b, c] : mesh.triangles)
    if (keeps(mesh.positions[a]) && keeps(mesh.positions[b]) && keeps(mesh.positions[c]))
      part.triangles.push_back({newIndex[a], newIndex[b], newIndex[c]});
  return part;
}

struct Lane {
  Method method;
  World::BodyId needle, membrane, shown;
  std::vector<std::uint32_t> shownOf;  ///< the membrane's vertex of each one that is shown
  bool passed = false;
};

class FastNeedle : public LiveScene {
 public:
  explicit FastNeedle(int threads) : m_world(threads) {
    addLane("Proximity", Method::Proximity, -1);
    addLane("Continuous", Method::Continuous, 0);
    addLane("Auto", Method::Auto, 1);
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    std::vector<BodyLook> looks;
    for (const Lane& lane : m_lanes) {
      looks.push_back({lane.needle, "", kSteelColour, 1, true, 0, 0.3, 1});
      looks.push_back({lane.membrane, "", kTissueColour, 0});
      looks.push_back({lane.shown, "", kTissueColour});
    }
    return looks;
  }

  PictureView view() override {
    return {.from = {0, -1, 0.22}, .centre = {0, 0, -1.5}, .height = 31};
  }

  /// Each needle's way from the start, and whether its method found the membrane.
  std::vector<PictureNote> notes() override {
    std::vector<PictureNote> notes;
    for (const Lane& lane : m_lanes) {
      const Vector3d tip = m_world.positions(lane.needle).front(), start(tip.x(), tip.y(), kAbove),
                     end(tip.x(), tip.y(), tip.z() + kNeedleLength);
      const bool found = contacts(lane) > 0;
      const Colour colour = found ? Colour{0, 0.45, 0.35} : Colour{0.75, 0.25, 0};
      notes.push_back({"", end, start});
      notes.push_back({m_world.bodies()[lane.needle].name, {tip.x(), tip.y(), kAbove + 1.2}});
      notes.push_back({found ? "found: the membrane holds it" : "missed: it is through",
                       {tip.x(), tip.y(), -12.5},
                       {},
                       colour});
    }
    notes.push_back(
        {"10 mm in a frame", m_world.positions(m_lanes[0].needle).front() + Vector3d(4, 0, 15)});
    return notes;
  }

  void computeFrame(int frame) override {
    m_world.predict(kFrame, Vector3d::Zero(), 0.1);
    for (const Lane& lane : m_lanes) drive(lane, frame % kPeriod < kFramesDown ? kBelow : kAbove);
    for (int round = 0; round < kRounds; ++round) {
      m_world.detect();
      m_world.solve(kIterations);
    }
    m_world.hold();
    m_world.commit();
    for (const Lane& lane : m_lanes)
      for (std::size_t i = 0; i < lane.shownOf.size(); ++i)
        m_world.positions(lane.shown)[i] = m_world.positions(lane.membrane)[lane.shownOf[i]];
  }

  std::vector<std::pair<std::string, double>> values() override {
    std::vector<std::pair<std::string, double>> values;
    for (const Lane& lane : m_lanes) {
      values.emplace_back(m_world.bodies()[lane.needle].name + " passed", lane.passed);
      values.emplace_back(m_world.bodies()[lane.needle].name + " contacts", contacts(lane));
    }
    return values;
  }

  std::string fault() override {
    for (Lane& lane : m_lanes) {
      lane.passed |= isThrough(lane);
      if (lane.passed && lane.method != Method::Proximity)
        return m_world.bodies()[lane.needle].name + " let the needle through.";
    }
    return "";
  }

 private:
  void addLane(const std::string& name, Method method, int side) {
    const Vector3d centre(side * kSpacing, 0, 0);
    SceneMesh needle = needleMesh(), membrane = sheet(24);
    for (Vector3d& p : needle.positions) p += centre + Vector3d(0.3, 0.2, kAbove);
    for (Vector3d& p : membrane.positions) p = centre + kHalfWidth * p;
    Lane lane{method,
              m_world.addMesh(name, needle, 0.0),
              m_world.addMesh(name + " membrane", membrane, 1.0),
              0,
              {}};
    const auto shown = [&](const Vector3d& p) {  // a section through the needle's way
      return std::abs(p.x() - centre.x()) < kShown && p.y() > -0.1 && p.y() < kShown;
    };
    lane.shown = m_world.addMesh(name + " section", partOf(membrane, shown, lane.shownOf), 0.0);
    m_world.pin(lane.membrane, [&](const Vector3d& p) {
      return (p - centre).head<2>().lpNorm<Eigen::Infinity>() > 0.999 * kHalfWidth;
    });
    m_world.addStiffness(lane.membrane, 1e-5, 1e-3);
    // Rows for all contacts: within a step this long features slide after their first impact. With
    // Contacts::Distinct the guard moves vertices back in more frames.
    m_world.addPair(lane.needle, lane.membrane,
                    {.method = method, .thickness = kThickness, .contacts = Contacts::All},
                    kThickness);
    if (method != Method::Proximity) {
      m_world.addGuard(lane.needle, lane.membrane);
      m_world.addRigid(lane.needle, m_world.bodies()[lane.needle].count);
    }
    m_lanes.push_back(lane);
  }

  std::size_t contacts(const Lane& lane) const {
    const CollisionData& data = m_world.contacts(lane.needle, lane.membrane);
    return data.vertexTriangle().size() + data.triangleVertex().size() + data.edgeEdge().size();
  }

  /// As far towards a height of the tip as the speed allows.
  void drive(const Lane& lane, double height) {
    const double way = height - m_world.before(lane.needle).front().z();
    const Vector3d step(0, 0, std::clamp(way, -kSpeed, kSpeed));
    for (Vector3d& p : m_world.positions(lane.needle)) p += step;
  }

  /// The tip is below the triangle of the membrane that it is in, in plan, or the two intersect.
  bool isThrough(const Lane& lane) {
    const Vector3d tip = m_world.positions(lane.needle).front();
    bool isBelow = false;
    for (const auto& [a, b, c] : m_world.bodies()[lane.membrane].triangles) {
      const std::span<const Vector3d> p = m_world.positions(lane.membrane);
      const Vector3d normal = (p[b] - p[a]).cross(p[c] - p[a]);
      const auto isLeft = [&](const Vector3d& from, const Vector3d& to) {
        return (to - from).cross(tip - from).z() >= 0;
      };
      isBelow |= isLeft(p[a], p[b]) && isLeft(p[b], p[c]) && isLeft(p[c], p[a]) &&
                 normal.dot(tip - p[a]) < 0;
    }
    return isBelow || m_world.intersect(lane.needle, lane.membrane);
  }

  World m_world;
  std::vector<Lane> m_lanes;
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  return runScene(
      {.name = "FastNeedle",
       .description = "A needle at 20 thicknesses a frame through a membrane, found by Proximity "
                      "(left: no contacts), Continuous (middle) and Auto (right).",
       .frames = 96,
       .frameMilliseconds = 1000.0 / 60,
       .collisionMilliseconds = 1,
       .keys = "n",
       .make = [](int threads) { return std::make_unique<FastNeedle>(threads); }},
      count, arguments);
}
