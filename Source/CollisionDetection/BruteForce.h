#pragma once

#include <palpate/Types.h>

#include "Core/Buffer.h"
#include "NarrowPhase/NarrowPhase.h"

namespace palpate {

/// Every triangle pair whose boxes in double, inflated by half the thickness each, overlap; sorted.
/// The oracle of the octree's candidates. Self-collision: a < b, sharing no vertex.
void findCandidatesByBruteForce(const MeshPair&, Buffer<TrianglePair>& out);

/// Keeps those whose boxes over the step, or now, overlap at this thickness.
void keepOverlapping(const MeshPair&, bool swept, double thickness, Buffer<TrianglePair>& pairs);

}  // namespace palpate
