#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/SearchableGeometry.h"
#include "Shapes/Shape.h"

#include <cstdint>
#include <vector>

namespace palpate {

/// Scratch of distanceBetween(), which keeps its peak.
struct DistanceScratch {
  /// Two nodes, one of each octree, and a bound of the distance between their boxes.
  struct NodePair {
    float square;
    std::uint32_t a, b;
  };
  std::vector<NodePair> heap;
  ShapePairScratch shapes;
};

/// The least distance between two geometries that both have elements, with the closest points. Of
/// equally near pairs, that of the lowest element of a, then of b. 0 if they have a common point.
///
/// Method   best-first descent of both octrees: the pair of nodes with the nearest boxes comes next,
///          and the larger node is replaced by its children. Ends when no boxes are nearer than the
///          best pair of elements.
GeometryDistance distanceBetween(const SearchableGeometry& a, const SearchableGeometry& b,
                                 bool bruteForce, DistanceScratch&);

}  // namespace palpate
