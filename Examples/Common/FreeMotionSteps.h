#pragma once

#include "World.h"

#include <Eigen/Core>

#include <vector>

namespace palpate::scenes {

/// Steps of a World in which nothing passes through, without time of impact and without a guard.
/// In each round every vertex goes towards where the solver wants it, but no further than its free
/// motion. Contacts, with their thickness, are the World's; free motion keeps only distance 0
/// apart, so that bodies come into contact.
///
/// Needs    bodies with particles; place() and shapes are not for these steps.
class FreeMotionSteps {
 public:
  /// Of all pairs that the world has now. reach: L, twice the longest motion of a round.
  FreeMotionSteps(World&, double reach, int threads);

  /// Call between predict() and commit(), with driven particles where they should go. They wait
  /// where their free motion is too short.
  void move(int rounds, int iterations);

 private:
  void clamp();

  World& m_world;
  OctreeBasedCD m_detection;
  std::vector<GeometryId> m_ids;
  std::vector<Eigen::Vector3d> m_reached;  ///< the positions so far, while the solver has its own
};

}  // namespace palpate::scenes
