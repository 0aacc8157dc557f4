#include "Simplify/SimplifyBy.h"

#include <Eigen/Geometry>
#include <meshoptimizer.h>

#include <array>
#include <cstdint>

namespace palpate {

/// By quadric error metrics: where the metric of a collapse exceeds the error, the edge stays. The
/// metric estimates the distance of the surfaces and does not bound it.
static std::vector<Triangle> collapseEdges(std::span<const Eigen::Vector3d> positions,
                                           std::span<const Triangle> triangles, double error) {
  if (triangles.empty()) return {};
  constexpr std::uint32_t kUnused = 0xffffffff;
  std::vector<std::uint32_t> numbers(positions.size(), kUnused), vertices;
  std::vector<unsigned int> indices;
  indices.reserve(3 * triangles.size());
  Eigen::AlignedBox3d box;
  for (const Triangle& triangle : triangles)
    for (const std::uint32_t v : triangle) {
      if (numbers[v] == kUnused) {
        numbers[v] = static_cast<std::uint32_t>(vertices.size());
        vertices.push_back(v);
        box.extend(positions[v]);
      }
      indices.push_back(numbers[v]);
    }
  const double extent = box.sizes().maxCoeff();
  if (!(extent > 0.0)) return {triangles.begin(), triangles.end()};
  std::vector<std::array<float, 3>> floats(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Eigen::Vector3d p = (positions[vertices[i]] - box.min()) / extent;
    floats[i] = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
  }
  std::vector<unsigned int> simplified(indices.size());
  simplified.resize(meshopt_simplify(simplified.data(), indices.data(), indices.size(),
                                     floats[0].data(), floats.size(), sizeof(floats[0]), 0,
                                     static_cast<float>(error / extent), meshopt_SimplifyLockBorder,
                                     nullptr));
  std::vector<Triangle> result(simplified.size() / 3);
  for (std::size_t i = 0; i < simplified.size(); ++i)
    result[i / 3][i % 3] = vertices[simplified[i]];
  return result;
}

SimplifiedMesh simplify(const TriangleMeshView& mesh, const SimplifySettings& settings) {
  return simplifyBy(&collapseEdges, mesh, settings);
}

}  // namespace palpate
