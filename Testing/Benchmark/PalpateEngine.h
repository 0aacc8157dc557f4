#pragma once

#include "BroadPhase.h"

#include <palpate/OctreeBasedCD.h>

namespace palpate::benchmark {

enum class PairOrder {
  Found,  ///< forEachCandidate(), kept as they come: what the peers deliver
  Sorted  ///< collectCandidates() and candidatePairs()
};

/// Palpate as a user calls it; settings are the defaults but for the two that the name says.
std::unique_ptr<BroadPhase> makePalpate(OctreeUpdate, PairOrder);

/// The task's meshes and pairs in a new OctreeBasedCD. thickness 0: the task's own.
struct PalpateScene {
  PalpateScene(const Task&, const Positions&, OctreeUpdate = OctreeUpdate::Auto,
               double thickness = 0);
  void setPositions(const Positions&);

  OctreeBasedCD detection;
  std::vector<GeometryId> ids;
};

}  // namespace palpate::benchmark
