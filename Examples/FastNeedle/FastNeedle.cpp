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

struct Lane {
  Method method;
  World::BodyId needle, membrane;
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
      looks.push_back({lane.needle, m_world.bodies()[lane.needle].name, kNeedleColour});
      looks.push_back({lane.membrane, "", kStomachColour, 0.6});
    }
    return looks;
  }

  PictureView view() override { return {.from = {0.2, -1, 0.45}}; }

  void computeFrame(int frame) override {
    m_world.predict(kFrame, Vector3d::Zero(), 0.1);
    for (const Lane& lane : m_lanes) drive(lane, frame % kPeriod < kFramesDown ? kBelow : kAbove);
    for (int round = 0; round < kRounds; ++round) {
      m_world.detect();
      m_world.solve(kIterations);
    }
    m_world.hold();
    m_world.commit();
  }

  std::vector<std::pair<std::string, double>> values() override {
    std::vector<std::pair<std::string, double>> values;
    for (const Lane& lane : m_lanes) {
      values.emplace_back(m_world.bodies()[lane.needle].name + " passed", lane.passed);
      values.emplace_back(m_world.bodies()[lane.needle].name + " force mN",
                          m_world.force(lane.needle).norm());
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
    const Vector3d centre(side * 2.2 * kHalfWidth, 0, 0);
    SceneMesh needle = needleMesh(), membrane = sheet(24);
    for (Vector3d& p : needle.positions) p += centre + Vector3d(0.3, 0.2, kAbove);
    for (Vector3d& p : membrane.positions) p = centre + kHalfWidth * p;
    Lane lane{method, m_world.addMesh(name, needle, 0.0),
              m_world.addMesh(name + " membrane", membrane, 1.0)};
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

  /// As far towards a height of the tip as the speed allows.
  void drive(const Lane& lane, double height) {
    const double way = height - m_world.before(lane.needle).front().z();
    const Vector3d step(0, 0, std::clamp(way, -kSpeed, kSpeed));
    for (Vector3d& p : m_world.positions(lane.needle)) p += step;
  }

  /// The tip is below the membrane's vertex that is nearest to it in plan, all of the needle under
  /// the rim's plane: nothing holds it.
  bool isThrough(const Lane& lane) {
    const auto view = [&](World::BodyId id) {
      return TriangleMeshView{m_world.positions(id), m_world.bodies()[id].triangles};
    };
    const Vector3d tip = m_world.positions(lane.needle).front();
    const Vector3d* below = nullptr;
    double nearest = kHalfWidth;
    for (const Vector3d& p : m_world.positions(lane.membrane)) {
      const double distance = (p - tip).head<2>().norm();
      if (distance < nearest) nearest = distance, below = &p;
    }
    return tip.z() < below->z() - kThickness ||
           !palpate::detectCollision(view(lane.needle), view(lane.membrane),
                                     {.method = Method::Intersection})
                .intersectingTriangles()
                .empty();
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
       .make = [](int threads) { return std::make_unique<FastNeedle>(threads); }},
      count, arguments);
}
