#pragma once

#include "Queries/BodyPair.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

struct InsideRegionsScratch {
  CountedVector<std::uint8_t> meets;      ///< per triangle: whether it meets the other surface
  CountedVector<std::uint32_t> regionOf;  ///< per vertex: the vertex that stands for its region
  CountedVector<std::uint8_t> sides;      ///< per vertex: what is known of its region
};

/// Finds the vertices of one body that are inside the other, a not moved: at most about `most`,
/// each of equally many. Ascending.
///
/// Method   triangles that do not meet the other surface join their vertices to regions, which are
///          inside as a whole or outside. So one vertex of each region is tested.
/// Shapes   intersecting: all pairs of triangles with a common point
void findInsideVertices(const BodyPair&, bool ofA,
                        std::span<const BodyPair::IntersectingTriangles> intersecting,
                        std::size_t most, InsideRegionsScratch&,
                        CountedVector<std::uint32_t>& inside);

}  // namespace palpate
