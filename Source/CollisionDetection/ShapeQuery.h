#pragma once

#include "CollisionDetection/GeometryTable.h"
#include "Octree/PointQueries.h"

namespace palpate {

/// Primitives of the geometry's octree of which some point may be within `reach` of the shape: all
/// that are, and some more.
///
/// Source   the distance to a convex shape is convex: over a box it is nowhere less than at the centre, less
///          what the slope there takes away on the way to a corner.
void findPrimitivesNear(const Geometry&, const Shape&, double reach, PointQueryStack&,
                        Buffer<std::uint32_t>& out);

}  // namespace palpate
