#pragma once

#include <palpate/Types.h>

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// The triangles that a tetrahedral mesh collides with: the faces of exactly one tetrahedron, each
/// with the one whose face it is.
///
/// Order    by tetrahedron, then as its corners are that the faces do not have. So `tetrahedra`
///          ascends.
/// Winding  outward of the tetrahedron as it is at rest, whichever way its corners are given: that
///          is decided exactly. One without volume is wound as its neighbours are, from one with
///          volume on by the fewest faces, of several ways one; with none of these, as the lowest
///          is given. Deformed and inverted, triangles keep their winding.
struct TetrahedralSurface {
  std::span<const Triangle> triangles;
  std::span<const std::uint32_t> tetrahedra;
};

/// Where a point is in a tetrahedral mesh: the weighted sum of the corners' positions.
///
/// Weights  sum 1 within 2^-50; each at least 0, and exactly 0 where the point is on the face
///          without that corner; within 2^-49 of its value.
struct TetrahedronPoint {
  std::uint32_t tetrahedron;
  Tetrahedron corners;
  std::array<double, 4> weights;
  friend bool operator==(const TetrahedronPoint&, const TetrahedronPoint&) = default;
};

/// A vertex of another geometry in a tetrahedral mesh.
struct EmbeddedVertex {
  std::uint32_t vertex;
  TetrahedronPoint at;
  friend bool operator==(const EmbeddedVertex&, const EmbeddedVertex&) = default;
};

}  // namespace palpate
