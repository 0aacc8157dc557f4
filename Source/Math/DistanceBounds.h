#pragma once

#include "Math/VertexTriangleDistances.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>

namespace palpate {

/// Distances of a point from up to eight triangles, computed in SIMD lanes.
struct DistanceBounds {
  /// L: the distance of a point of the triangle. It is at least the triangle's distance, up to
  /// `error`.
  alignas(64) std::array<double, TriangleBatch::kSize> distance;
  /// L: the triangle is at least that far away. Less than `distance` by rounding, in most cases.
  alignas(64) std::array<double, TriangleBatch::kSize> lower;
  alignas(64) std::array<double, TriangleBatch::kSize> error;  ///< L

  DistanceBounds(const Eigen::Vector3d& p, const TriangleBatch&, std::size_t count);
};

}  // namespace palpate
