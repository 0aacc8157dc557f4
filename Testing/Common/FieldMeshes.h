#pragma once

#include "Common/RandomMeshes.h"

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

/// Closed meshes that are difficult for a distance field.
namespace palpate::testing {

struct NamedMesh {
  std::string name;
  Mesh mesh;
};

inline Mesh torusMesh(std::uint32_t around, std::uint32_t across) {
  Mesh mesh;
  constexpr double kTurn = 2 * 3.14159265358979323846;
  for (std::uint32_t i = 0; i < around; ++i)
    for (std::uint32_t j = 0; j < across; ++j) {
      const double u = kTurn * i / around, v = kTurn * j / across, r = 1 + 0.3 * std::cos(v);
      mesh.positions.emplace_back(r * std::cos(u), r * std::sin(u), 0.3 * std::sin(v));
    }
  const auto at = [&](std::uint32_t i, std::uint32_t j) {
    return i % around * across + j % across;
  };
  for (std::uint32_t i = 0; i < around; ++i)
    for (std::uint32_t j = 0; j < across; ++j) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

/// A sphere whose vertices lie at very different distances from the centre.
inline Mesh starMesh(Random& random) {
  Mesh mesh = sphere(8, 11, {0, 0, 0}, 1.0);
  for (Eigen::Vector3d& p : mesh.positions) p *= uniform(random, 0.2, 1.0);
  return mesh;
}

inline std::vector<NamedMesh> fieldMeshes(Random& random) {
  std::vector<NamedMesh> meshes{
      {"sphere", sphere(20, 30, {0.1, 0.2, 0.3}, 1.0)},
      {"box", boxMesh({-1, -0.5, -0.25}, {1, 0.5, 0.25})},
      {"torus", torusMesh(24, 12)},
      {"plate", boxMesh({-1, -1, 0}, {1, 1, 1e-3})},
      {"star", starMesh(random)},
  };
  Mesh crossing = sphere(9, 12, {0, 0, 0}, 1.0);
  append(crossing, boxMesh({0.2, -0.3, -0.4}, {1.4, 0.3, 0.4}));
  meshes.push_back({"crossing", crossing});
  // Without volume: both sides of one square.
  Mesh flat;
  flat.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  flat.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  meshes.push_back({"flat", flat});
  for (const double scale : {1e-30, 1e30}) {
    Mesh scaled = meshes[2].mesh;
    for (Eigen::Vector3d& p : scaled.positions) p *= scale;
    meshes.push_back({scale < 1 ? "tiny" : "huge", scaled});
  }
  Mesh far = meshes[2].mesh;
  for (Eigen::Vector3d& p : far.positions) p += Eigen::Vector3d(1e6, -3e5, 2e6);
  meshes.push_back({"far", far});
  return meshes;
}

}  // namespace palpate::testing
