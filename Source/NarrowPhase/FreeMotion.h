#pragma once

#include "NarrowPhase/NarrowPhase.h"

#include <span>

namespace palpate {

/// L, one for each vertex of the meshes of a pair; the same span twice for self-collision.
struct FreeMotions {
  std::span<double> a, b;
};

/// Lowers the free motions of vertices of the candidate pairs, with the pair's filters. Elements
/// beyond the reach lower none below half of it. searchDistance: that of
/// FreeMotionRange.
///
/// Threads  safe for the same free motions.
/// Law      the least values depend neither on the order of calls nor on candidates that are
///          further apart than searchDistance.
/// Source   Docs/Algorithms/FreeMotion.md
void findFreeMotion(const MeshPair&, double searchDistance, std::span<const ElementPair> candidates,
                    const FreeMotions&);

}  // namespace palpate
