// A thread is pulled through the holes of two sheets and rubs at their edges. No step detects an
// impact: each vertex moves within its free motion.
#include "FreeMotionSteps.h"
#include "SceneProgram.h"

#include <array>
#include <cmath>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d;

// Lengths in mm, times in s.
constexpr int kSubsteps = 2, kRounds = 4, kIterations = 10, kFrames = 240;
constexpr double kStep = 1.0 / 60 / kSubsteps;
constexpr std::uint32_t kSegments = 120;
constexpr double kSegment = 0.25, kRadius = 0.05, kGap = 0.05, kReach = 0.5;

/// A sheet with a square hole, whose vertices away from the hole are pinned.
SceneMesh sheetWithHole(double height, const Vector3d& hole) {
  SceneMesh mesh = sheet(24);
  for (Vector3d& p : mesh.positions) p = 6 * p + Vector3d(0, 0, height);
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    const Vector3d centre =
        (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    return std::max(std::abs(centre.x() - hole.x()), std::abs(centre.y() - hole.y())) < 0.75;
  });
  return mesh;
}

std::vector<Vector3d> threadAtRest() {
  std::vector<Vector3d> line;
  for (std::uint32_t i = 0; i <= kSegments; ++i)
    line.push_back({0.3 * std::sin(0.2 * i), 0.3 * std::cos(0.2 * i), 3 + kSegment * i});
  return line;
}

class Threading : public LiveScene {
 public:
  explicit Threading(int threads)
      : m_world(threads), m_steps(made(), kReach, threads), m_check(Settings{.threads = threads}) {
    for (World::BodyId id = 0; id < 3; ++id) {
      const World::Body& body = m_world.bodies()[id];
      m_ids[id] = id == m_thread ? m_check.addLineMesh(m_world.positions(id), body.segments, 0.0)
                                 : m_check.addTriangleMesh(m_world.positions(id), body.triangles);
    }
    for (const World::Pair& pair : m_world.pairs())
      m_check.addCollisionPair(m_ids[pair.a], m_ids[pair.b],
                               {.method = Method::Continuous, .contacts = Contacts::All});
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    return {{m_thread, "Thread", kThreadColour},
            {m_sheets[0], "Upper sheet", kStomachColour},
            {m_sheets[1], "Lower sheet", kTissueColour}};
  }

  void computeFrame(int frame) override {
    m_impacts = 0;
    for (int substep = 1; substep <= kSubsteps; ++substep) {
      m_world.predict(kStep, Vector3d(0, 0, -50), 0.05);
      drive((frame + static_cast<double>(substep) / kSubsteps) / kFrames);
      m_steps.move(kRounds, kIterations);
      checkStep();
      m_world.commit();
    }
  }

  std::vector<std::pair<std::string, double>> values() override {
    return {{"tip mm", m_world.positions(m_thread)[0].z()}};
  }

  std::string fault() override {
    return m_impacts == 0
               ? ""
               : "features pass through each other in " + std::to_string(m_impacts) + " places.";
  }

 private:
  World& made() {
    m_thread = m_world.addThread("thread", threadAtRest(), kRadius, 1.0);
    m_world.solver().inverseMasses[0] = 0;  // the hand
    m_world.addStiffness(m_thread, 0, 1e-4);
    const PairSettings touching{.method = Method::Proximity, .thickness = kGap};
    for (int i = 0; i < 2; ++i) {
      m_sheets[i] = m_world.addMesh(
          i == 0 ? "upper" : "lower",
          sheetWithHole(-3 * i, i == 0 ? Vector3d(0, 0, 0) : Vector3d(1.5, 1, 0)), 0.1);
      m_world.pin(m_sheets[i], [](const Vector3d& p) {
        return std::max(std::abs(p.x()), std::abs(p.y())) > 5.9;
      });
      m_world.addStiffness(m_sheets[i], 1e-6, 1e-5);
      m_world.addPair(m_thread, m_sheets[i], touching, kGap);
    }
    m_world.addPair(m_sheets[0], m_sheets[1], touching, kGap);
    return m_world;
  }

  /// The hand leads the thread's end to the upper sheet, then through both holes, and down. Beside
  /// the hole it jabs through the sheet at once: the thread waits on the surface.
  void drive(double time) {
    const Vector3d points[] = {threadAtRest()[0], {2, 0, 1},    {0, 0, 1},    {0, 0, -1},
                               {1.5, 1, -2.5},    {1.5, 1, -4}, {1.5, 1, -14}};
    const double at = std::min(6 * time, 5.999);
    const int i = static_cast<int>(at);
    Vector3d& hand = m_world.positions(m_thread)[0];
    hand = points[i] + (at - i) * (points[i + 1] - points[i]);
    if (std::abs(at - 1) < 0.1) hand.z() -= 3;
  }

  /// Counts the impacts of the step, decided exactly.
  void checkStep() {
    for (World::BodyId id = 0; id < 3; ++id)
      m_check.setPositions(m_ids[id], m_world.before(id), m_world.positions(id));
    m_check.detectCollision();
    m_check.advance();
    for (const CollisionPair& pair : m_check.pairs()) {
      const CollisionData& data = m_check.collisionData(pair.a, pair.b);
      m_impacts +=
          data.vertexTriangle().size() + data.triangleVertex().size() + data.edgeEdge().size();
    }
  }

  World m_world;
  World::BodyId m_thread = 0;
  std::array<World::BodyId, 2> m_sheets{};
  FreeMotionSteps m_steps;
  OctreeBasedCD m_check;  // sees whole steps only, by the method that the steps do without
  std::array<GeometryId, 3> m_ids{};
  std::size_t m_impacts = 0;  // of the frame
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  return runScene(
      {.name = "Threading",
       .description = "A thread through the holes of two sheets, moved within its free motion.",
       .frames = kFrames,
       .frameMilliseconds = 1000.0 / 60,
       .make = [](int threads) { return std::make_unique<Threading>(threads); }},
      count, arguments);
}
