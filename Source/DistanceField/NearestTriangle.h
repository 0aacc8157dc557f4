#pragma once

#include "Bodies/Body.h"
#include "Math/VertexTriangleDistances.h"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>

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

/// Finds nearest triangles of a mesh without radii and transform, for distances that need not be
/// exact.
class NearestTriangle {
 public:
  struct Near {
    double distance;      ///< L
    std::uint32_t place;  ///< of a triangle at about that distance, in the octree's order
  };

  /// tolerance: L. Distances are off by no more, or by 16 u of the largest coordinate difference.
  NearestTriangle(const Body&, double tolerance);

  /// likely: places of at most eight triangles that are likely near.
  Near at(const Eigen::Vector3d& point, std::span<const std::uint32_t> likely) const;

 private:
  const Body& m_geometry;
  const double m_tolerance;
  float m_largest;  ///< in the octree's floats: the largest coordinate
};

}  // namespace palpate
