#pragma once

#include <palpate/Types.h>

#include "Contact/ContactBuffers.h"
#include "Mesh/Positions.h"
#include "Math/TriangleIntersection.h"
#include "Core/Buffer.h"

#include <span>

namespace palpate {

/// Triangles and their positions at one time.
struct PlacedTriangles {
  std::span<const Triangle> triangles;
  Positions positions;
};

/// Keeps the pairs that may intersect, in their order; all other pairs are proven not to. Where
/// floating point is certain, a kept pair also has the result of intersectTriangles(). self: a and
/// b are one mesh. Each kept pair then has the lower triangle first, and common vertices do not
/// count as intersections.
/// Errors   none; where coordinates overflow or underflow, all pairs with overlapping boxes are
///          kept.
void keepPossiblyIntersecting(const PlacedTriangles& a, const PlacedTriangles& b, bool self,
                              std::span<const ElementPair> pairs,
                              Buffer<PossibleIntersection>& out);

}  // namespace palpate
