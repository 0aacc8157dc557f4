#pragma once

#include "Octree/Octree.h"
#include "Mesh/FloatPositions.h"
#include "Core/Buffer.h"

#include <palpate/Types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// A convex shape in an octree's floats: all points within `radius` of a segment, or, if there are
/// slabs, all points between both planes of every slab.
struct FloatConvex {
  static constexpr std::size_t kMaxSlabs = 32;
  struct Slab {
    float normal[3], middle, halfWidth;  ///< between: |normal . x - middle| <= halfWidth
  };
  std::array<Slab, kMaxSlabs> slabs;
  std::size_t slabCount = 0;
  float start[3], along[3], inverseSquare, radius;
  /// A bound on the error of any distance from a plane or from the segment.
  float slack;
};

struct OverlapSearch {
  const Octree& octree;
  const FloatPoint* floats;  ///< per vertex
  const Triangle* ordered;   ///< elements in the octree's order
  const FloatConvex& shape;
};

/// Appends elements that certainly have a point in the shape to `elements`, by their ids, and those
/// that floats do not decide to `undecided`, by their places in the octree's order.
void searchOverlapping(const OverlapSearch&, std::vector<std::uint32_t>& elements,
                       Buffer<std::uint32_t>& undecided);

}  // namespace palpate
