#include "FreeMotionSteps.h"

#include <algorithm>
#include <span>

namespace palpate::scenes {

using Eigen::Vector3d;

FreeMotionSteps::FreeMotionSteps(World& world, double reach, int threads)
    : m_world(world), m_detection(Settings{.threads = threads}) {
  for (World::BodyId id = 0; id < world.bodies().size(); ++id) {
    const World::Body& body = world.bodies()[id];
    const std::span<const Vector3d> positions = world.positions(id);
    m_ids.push_back(body.type == GeometryType::Triangles
                        ? m_detection.addTriangleMesh(positions, body.triangles)
                    : body.type == GeometryType::Lines
                        ? m_detection.addLineMesh(positions, body.segments, 0.0)
                        : m_detection.addPointSet(positions, 0.0));
  }
  for (const World::Pair& pair : world.pairs())
    m_detection.addCollisionPair(m_ids[pair.a], m_ids[pair.b], {.freeMotionReach = reach});
}

void FreeMotionSteps::move(int rounds, int iterations) {
  Xpbd& solver = m_world.solver();
  m_reached = solver.before;
  for (int round = 0; round < rounds; ++round) {
    solver.now.swap(m_reached);
    m_world.detect();
    for (World::BodyId id = 0; id < m_ids.size(); ++id)
      m_detection.setPositions(m_ids[id], m_world.positions(id));
    m_detection.detectCollision();
    m_detection.advance();
    solver.now.swap(m_reached);
    m_world.solve(iterations);
    clamp();
  }
  solver.now = m_reached;
}

/// Moves what was reached towards the solver's positions.
void FreeMotionSteps::clamp() {
  const std::vector<Vector3d>& wanted = m_world.solver().now;
  for (World::BodyId id = 0; id < m_ids.size(); ++id) {
    const std::span<const double> free = m_detection.freeMotion(m_ids[id]);
    for (std::size_t i = 0; i < free.size(); ++i) {
      Vector3d& reached = m_reached[m_world.bodies()[id].first + i];
      const Vector3d step = wanted[m_world.bodies()[id].first + i] - reached;
      const double length = step.norm();
      reached += length > free[i] ? Vector3d(free[i] / length * step) : step;
    }
  }
}

}  // namespace palpate::scenes
