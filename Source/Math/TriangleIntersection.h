#pragma once

#include "Exact/Predicates.h"

#include <array>
#include <cstdint>

namespace palpate {

/// Positions of a triangle's corners; edge i joins corners i and i + 1 mod 3.
using Corners = std::array<Eigen::Vector3d, 3>;

/// How two triangles, as closed sets of points, intersect: which features have a point in common.
///
/// If nothing touches, triangles that intersect do so in a segment. At each end of the segment, an
/// edge of one triangle crosses the other: either two edges of one triangle, or one edge of each.
struct TriangleIntersection {
  /// The bit of edge i of a and edge j of b in a set of edge pairs.
  static constexpr unsigned edgesBit(int i, int j) { return 1u << (3 * i + j); }

  std::uint8_t cornersOfAOnB = 0, cornersOfBOnA = 0;  ///< bit i: corner i
  std::uint16_t touchingEdges = 0;                    ///< edgesBit()s
  /// Bit i: edge i crosses the other triangle's interior, and its ends are strictly on different
  /// sides.
  std::uint8_t edgesOfAThroughB = 0, edgesOfBThroughA = 0;
  bool touch() const { return (cornersOfAOnB | cornersOfBOnA | touchingEdges) != 0; }
  bool intersect() const { return touch() || (edgesOfAThroughB | edgesOfBThroughA) != 0; }
};

/// Feature pairs that are not tested for two triangles of one mesh, because they have a vertex in
/// common.
struct ExcludedFeatures {
  std::uint8_t cornersOfA = 0, cornersOfB = 0;  ///< bit i: corner i is the other triangle's too
  std::uint16_t edges = 0;                      ///< edgesBit()s
};

/// Finds every touching and crossing of two triangles, except for excluded features. The triangles
/// may have no area. Exact for any finite doubles.
///
/// Laws     (1) another order of the corners, or swapping the two triangles, permutes the bits and
///          changes nothing else.
///          (2) mirroring and scaling by powers of two change nothing.
/// Source   intervals on the planes' common line as in Guigue and Devillers, Fast and robust
///          triangle-triangle overlap test using orientation predicates, Journal of Graphics Tools
///          8 (2003). Difference: four volumes and no canonical order of the corners; three axis
///          projections in place of one chosen projection.
TriangleIntersection intersectTriangles(const Corners& a, const Corners& b, SignCounts&,
                                        const ExcludedFeatures& = {});

}  // namespace palpate
