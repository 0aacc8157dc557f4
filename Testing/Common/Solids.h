#pragma once

#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"

#include <algorithm>
#include <array>
#include <vector>

/// Tetrahedral meshes.
namespace palpate::testing {

struct Solid {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Tetrahedron> tetrahedra;
};

/// The unit cells of [0, n]³ for which `filled` holds, each as six tetrahedra around a diagonal.
/// Corners have integer coordinates. The order of the tetrahedra and of their corners is random.
template <class Filled>
Solid cells(int n, Random& random, Filled&& filled) {
  Solid solid;
  const auto vertex = [&](const std::array<int, 3>& at) {
    return static_cast<std::uint32_t>((at[0] * (n + 1) + at[1]) * (n + 1) + at[2]);
  };
  for (int x = 0; x <= n; ++x)
    for (int y = 0; y <= n; ++y)
      for (int z = 0; z <= n; ++z) solid.positions.emplace_back(x, y, z);
  for (int cell = 0; cell < n * n * n; ++cell) {
    const std::array<int, 3> corner{cell / (n * n), cell / n % n, cell % n};
    if (!filled(corner)) continue;
    std::array<int, 3> axes{0, 1, 2};
    do {
      Tetrahedron tetrahedron{vertex(corner)};
      std::array<int, 3> at = corner;
      for (int i = 0; i < 3; ++i) {
        ++at[axes[i]];
        tetrahedron[i + 1] = vertex(at);
      }
      std::shuffle(tetrahedron.begin(), tetrahedron.end(), random);
      solid.tetrahedra.push_back(tetrahedron);
    } while (std::next_permutation(axes.begin(), axes.end()));
  }
  std::shuffle(solid.tetrahedra.begin(), solid.tetrahedra.end(), random);
  return solid;
}

inline Solid cells(int n, Random& random) {
  return cells(n, random, [](const auto&) { return true; });
}

/// The surface as a mesh of the same positions.
inline Mesh surfaceMeshOf(const Solid& solid) {
  OctreeBasedCD collisions;
  const auto surface =
      collisions.surface(collisions.addTetrahedralMesh(solid.positions, solid.tetrahedra));
  return {solid.positions, {surface.triangles.begin(), surface.triangles.end()}};
}

}  // namespace palpate::testing
