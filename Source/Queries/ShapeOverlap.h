#pragma once

#include "Core/Buffer.h"
#include "Octree/PointQueries.h"
#include "Queries/SearchableGeometry.h"
#include "Shapes/Shape.h"

#include <cstdint>
#include <vector>

namespace palpate {

/// Appends the elements that meet a shape, in any order. bruteForce: every element is tested. Balls
/// are decided exactly, and so are hulls and boxes if elements have no radius; others in floating
/// point.
void findOverlapping(const SearchableGeometry&, const Shape&, bool bruteForce, PointQueryStack&,
                     Buffer<std::uint32_t>& near, std::vector<std::uint32_t>& out);

}  // namespace palpate
