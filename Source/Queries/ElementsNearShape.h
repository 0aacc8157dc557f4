#pragma once

#include "Queries/SearchableGeometry.h"
#include "Octree/PointQueries.h"

namespace palpate {

/// Elements of the geometry's octree of which some point may be within `reach` of the shape: all
/// that are, and some more.
///
/// Source   the distance to a convex shape is convex: over a box it is nowhere less than at the centre, less
///          what the slope there takes away on the way to a corner.
///
/// At any time of the step; the same shape twice: as it is now.
void findElementsNear(const SearchableGeometry&, const Shape& before, const Shape& now,
                      double reach, PointQueryStack&, Buffer<std::uint32_t>& out);

}  // namespace palpate
