#pragma once

#include <palpate/Types.h>

#include "Core/Buffer.h"
#include "Geometry/Positions.h"

#include <span>

namespace palpate {

/// Triangles where they are at some time.
struct PlacedTriangles {
  std::span<const Triangle> triangles;
  Positions positions;
};

/// Appends those pairs that may intersect, in their order: those left out are proven not to, as
/// intersectTriangles() decides it. self: the two are one mesh, and what triangles with a common
/// vertex are not asked for is excluded.
/// Errors   none; where coordinates over- or underflow all pairs whose boxes overlap are kept.
void keepPossiblyIntersecting(const PlacedTriangles& a, const PlacedTriangles& b, bool self,
                              std::span<const TrianglePair> pairs, Buffer<TrianglePair>& out);

}  // namespace palpate
