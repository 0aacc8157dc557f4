#pragma once

#include <palpate/Types.h>

#include "Core/Buffer.h"
#include "NarrowPhase/NarrowPhase.h"

namespace palpate {

/// Every triangle pair whose boxes in double, inflated by half the thickness each, overlap; sorted.
/// The oracle of the octree's candidates. Self-collision: a < b, sharing no vertex.
void findCandidatesByBruteForce(const MeshPair&, Buffer<TrianglePair>& out);

}  // namespace palpate
