#pragma once

#include "Exact/Predicates.h"

#include <array>
#include <cstdint>

namespace palpate {

/// Positions of a triangle's corners; edge i joins corners i and i + 1 mod 3.
using Corners = std::array<Eigen::Vector3d, 3>;

/// How two triangles, as closed sets of points, meet: which features have a point in common.
///
/// Where nothing touches, triangles that meet do so in a segment, and each of its ends is where an
/// edge of one crosses the other: either two edges of one, or one of each.
struct TriangleIntersection {
  /// Of edge i of a and edge j of b, in sets of edge pairs.
  static constexpr unsigned edgesBit(int i, int j) { return 1u << (3 * i + j); }

  std::uint8_t cornersOfAOnB = 0, cornersOfBOnA = 0;  ///< bit i: corner i
  std::uint16_t touchingEdges = 0;                    ///< edgesBit()s
  /// Bit i: edge i crosses the other's interior, its ends strictly on either side.
  std::uint8_t edgesOfAThroughB = 0, edgesOfBThroughA = 0;
  bool touch() const { return (cornersOfAOnB | cornersOfBOnA | touchingEdges) != 0; }
  bool intersect() const { return touch() || (edgesOfAThroughB | edgesOfBThroughA) != 0; }
};

/// Feature pairs that two triangles of one mesh are not asked for, as they have a vertex in common.
struct ExcludedFeatures {
  std::uint8_t cornersOfA = 0, cornersOfB = 0;  ///< bit i: corner i is the other triangle's too
  std::uint16_t edges = 0;                      ///< edgesBit()s
};

/// Every touching and crossing of two triangles, with area or without, outside of excluded
/// features. Exact for any finite doubles.
///
/// Laws     (1) corners in another order, or the two triangles swapped, move the bits and change nothing else.
///          (2) so do mirroring and scaling by powers of two.
/// Source   intervals on the planes' common line as Guigue and Devillers, Fast and robust triangle-triangle
///          overlap test using orientation predicates, Journal of Graphics Tools 8 (2003).
///          Difference: four volumes and no canonical order of the corners; and three axis
///          projections in place of a chosen one.
TriangleIntersection intersectTriangles(const Corners& a, const Corners& b, SignCounts&,
                                        const ExcludedFeatures& = {});

}  // namespace palpate
