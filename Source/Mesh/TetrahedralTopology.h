#pragma once

#include <palpate/Meshes.h>

#include "Mesh/TriangleMesh.h"
#include "Core/CountedVector.h"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <span>

namespace palpate {

/// Face i of a tetrahedron is the face without corner i. It is wound outward if the volume is
/// positive, which means that corner 3 is where the winding normal of corners 0, 1, 2 points.
inline Triangle faceOf(const Tetrahedron& t, unsigned i) {
  constexpr std::array<std::array<std::uint8_t, 3>, 4> kFaces{
      {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
  return {t[kFaces[i][0]], t[kFaces[i][1]], t[kFaces[i][2]]};
}

/// Tetrahedra, and the surface triangles between them and the outside.
struct TetrahedralTopology {
  CountedVector<Tetrahedron> tetrahedra;      ///< as given
  CountedVector<Triangle> surface;            ///< see TetrahedralSurface
  CountedVector<std::uint32_t> surfaceOwner;  ///< the tetrahedron of each surface triangle
  /// For each tetrahedron, whether its volume at rest is positive. One without volume has the sign
  /// that fits its neighbours.
  CountedVector<bool> isPositive;
  CountedVector<std::uint32_t> removed{};  ///< tetrahedra that cuts removed, ascending
  bool hasFlat = false;                    ///< some tetrahedron has no volume at rest

  // Of TetrahedraCut, which makes them when it first needs them:
  IndexLists vertexTetrahedra{};  ///< ascending, without removed ones
  /// For each tetrahedron, the surface triangles at its faces; kNoElement where there is none.
  CountedVector<std::array<std::uint32_t, 4>> faceIds{};

  /// Calls f(tetrahedron) for those that were not removed, ascending.
  template <class F>
  void forEach(F&& f) const {
    forEachWithout(tetrahedra.size(), removed, f);
  }
};

/// A face that more than two tetrahedra share: its vertices, ascending, and the first three
/// tetrahedra.
struct OverusedFace {
  Triangle face;
  std::array<std::uint32_t, 3> tetrahedra;
};

/// Indices must be in range, and the four of a tetrahedron different. `fault` receives the first
/// invalid face, in the order of the faces' vertices. removed: ascending; they count as absent.
TetrahedralTopology topologyOf(std::span<const Eigen::Vector3d> rest,
                               std::span<const Tetrahedron> tetrahedra,
                               std::optional<OverusedFace>& fault,
                               std::span<const std::uint32_t> removed = {});

/// Gives surface triangles the ids that equal ones have in `ids`, and others the next ids in their
/// order. An id without a triangle gets {0, 0, 0} and the owner kNoElement. Returns these ids.
CountedVector<std::uint32_t> keepSurfaceIds(std::span<const Triangle> ids,
                                            TetrahedralTopology& topology);

/// Of the surface triangles, where the tetrahedra have these tags, or none.
CountedVector<std::uint32_t> tagsOfSurface(const TetrahedralTopology&,
                                           std::span<const std::uint32_t> tags);

}  // namespace palpate
