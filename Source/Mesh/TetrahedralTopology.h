#pragma once

#include <palpate/TetrahedralMesh.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

/// Face i of a tetrahedron is the one without corner i, wound outward if its volume is positive:
/// corner 3 is where the winding normal of corners 0, 1, 2 points.
inline Triangle faceOf(const Tetrahedron& t, unsigned i) {
  constexpr std::array<std::array<std::uint8_t, 3>, 4> kFaces{
      {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
  return {t[kFaces[i][0]], t[kFaces[i][1]], t[kFaces[i][2]]};
}

/// Tetrahedra, and the triangles between them and the outside.
struct TetrahedralTopology {
  std::vector<Tetrahedron> tetrahedra;      ///< as given
  std::vector<Triangle> surface;            ///< see TetrahedralSurface
  std::vector<std::uint32_t> surfaceOwner;  ///< the tetrahedron of each of these, ascending
};

/// A face of more than two tetrahedra, its vertices ascending, and the first three of these.
struct OverusedFace {
  Triangle face;
  std::array<std::uint32_t, 3> tetrahedra;
};

/// Indices must be in range, and each four different. `fault`: the first face that is refused, in
/// the order of its vertices.
TetrahedralTopology topologyOf(std::span<const Eigen::Vector3d> rest,
                               std::span<const Tetrahedron> tetrahedra,
                               std::optional<OverusedFace>& fault);

}  // namespace palpate
