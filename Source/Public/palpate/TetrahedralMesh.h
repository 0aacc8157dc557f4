#pragma once

#include <palpate/Types.h>

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

}  // namespace palpate
