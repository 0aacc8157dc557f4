#pragma once

#include <palpate/Settings.h>

#include "CollisionDetection/PairTable.h"

namespace palpate {

// The plan of a pair in a frame is made here and nowhere else, in two steps. The first comes before
// the update of octrees, whose boxes have to enclose the step for some methods. The second comes
// after it, because it searches octrees.

/// The plan of a pair before anything is known about its motion.
void planWithoutMotion(PairRecord&);

/// Auto: whether the settings allow the surface proxy that is attached to b.
bool mayUseProxy(const PairRecord&);

/// Plans by the motion in the step, which it updates. detecting: contacts are wanted; otherwise
/// only the motion on which candidates depend is included. Whether the boxes of both octrees have
/// to enclose the step is then PairPlan::swept().
void planStep(PairRecord&, bool detecting);

/// Decides for which of the planned pairs the candidates of KeptPairs are used, and which octrees
/// may lag behind the positions. Measures the motion that these need.
void planKeptPairs(const GeometryTable&, std::span<const std::unique_ptr<PairRecord>>,
                   const Settings&);
/// A plan was completed: decides again. Returns whether an octree that lags must be updated.
bool reviewKeptPairs(PairRecord&);
/// A detection was completed: stops keeping for a while where lists cost more than searches.
void reviewLists(PairRecord&);
/// How far the lists of a pair that keeps its candidates reach.
KeptPairs::Reach reachOfKept(const PairRecord&);
/// In how many detections the first lists are made.
std::size_t detectionsToGather(const PairRecord&, const KeptPairs::Reach&);

/// Auto: plans that an attached field answers, if that is allowed, and if the field proves that
/// nothing touched in the step. The octrees must be updated.
void planByFieldIfProven(PairRecord&, Engine);

}  // namespace palpate
