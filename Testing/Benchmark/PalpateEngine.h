#pragma once

#include "BroadPhase.h"

#include <palpate/OctreeBasedCD.h>

namespace palpate::benchmark {

enum class PairOrder {
  Found,  ///< forEachCandidate(), in the order found, as the baselines deliver them
  Sorted  ///< candidatePairs()
};

/// Palpate as a user calls it. All other settings are the defaults.
std::unique_ptr<BroadPhase> makePalpate(OctreeUpdate, PairOrder);

/// The task's meshes and pairs in a new OctreeBasedCD. With thickness 0 it takes the task's
/// thickness.
struct PalpateScene {
  PalpateScene(const Task&, const Positions&, OctreeUpdate = OctreeUpdate::Auto,
               double thickness = 0);
  void setPositions(const Positions&);

  OctreeBasedCD detection;
  std::vector<GeometryId> ids;
};

/// update() and forEachCandidate(): their times, and the number of pairs.
FrameStatistics findCandidates(OctreeBasedCD&);

}  // namespace palpate::benchmark
