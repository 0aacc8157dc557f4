#pragma once

#include "Common/Solids.h"

namespace palpate::testing {

/// Triangles of a cube, wound outwards.
inline Mesh cube(double low, double high) {
  Mesh mesh;
  for (int v = 0; v < 8; ++v)
    mesh.positions.emplace_back(v & 1 ? high : low, v & 2 ? high : low, v & 4 ? high : low);
  mesh.triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  return mesh;
}

}  // namespace palpate::testing
