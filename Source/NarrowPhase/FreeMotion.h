#pragma once

#include "NarrowPhase/NarrowPhase.h"
#include "Math/FreeMotion.h"

#include <span>

namespace palpate {

/// Of the meshes of a pair; the same spans twice for self-collision.
struct FreeMotions {
  std::span<double> a, b;                        ///< L, one for each vertex
  std::span<const RoundBox> boxesOfA, boxesOfB;  ///< boxElements()
};

/// The box of each element, at its present position. The octrees may hold larger ones: of the step.
void boxElements(const TriangleMesh&, std::span<RoundBox>);

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
