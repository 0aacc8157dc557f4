#pragma once

#include <palpate/Types.h>

#include "Core/Buffer.h"
#include "Mesh/Positions.h"
#include "Math/TriangleIntersection.h"

#include <span>

namespace palpate {

/// Triangles where they are at some time.
struct PlacedTriangles {
  std::span<const Triangle> triangles;
  Positions positions;
};

struct PossibleIntersection {
  ElementPair triangles;
  TriangleIntersection meeting;  ///< if known: where edges cross and nothing touches
  bool isKnown() const { return meeting.intersect(); }
};

/// The pairs that may intersect, in their order, with what intersectTriangles() finds wherever
/// floating point is certain; those left out are proven not to. self: the two are one mesh, pairs
/// come with the lower triangle first, and what triangles with a common vertex are not asked for is
/// excluded.
/// Errors   none; where coordinates over- or underflow all pairs whose boxes overlap are kept.
void keepPossiblyIntersecting(const PlacedTriangles& a, const PlacedTriangles& b, bool self,
                              std::span<const ElementPair> pairs,
                              Buffer<PossibleIntersection>& out);

}  // namespace palpate
