#pragma once

#include <palpate/FeaturePairs.h>

#include "Core/Assert.h"

#include <cstddef>
#include <cstdint>

namespace palpate {

/// Up to eight triangles, each coordinate of a corner side by side.
struct TriangleBatch {
  static constexpr std::size_t kSize = 8;
  alignas(64) double corners[3][3][kSize] = {};  ///< L: corner, axis, triangle

  void set(std::size_t i, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
           const Eigen::Vector3d& c) {
    PALPATE_ASSERT(i < kSize);
    for (int k = 0; k < 3; ++k) {
      corners[0][k][i] = a[k];
      corners[1][k][i] = b[k];
      corners[2][k][i] = c[k];
    }
  }
  Eigen::Vector3d corner(std::size_t i, std::size_t number) const {
    return {corners[number][0][i], corners[number][1][i], corners[number][2][i]};
  }
};

/// finiteVertexTriangleDistance() of one vertex and each triangle of a batch, with the same bits,
/// computed in SIMD lanes.
class VertexTriangleDistances {
 public:
  /// Answers the first `count` triangles.
  VertexTriangleDistances(const Eigen::Vector3d& p, const TriangleBatch&, std::size_t count);

  VertexTriangleDistance operator[](std::size_t i) const;
  /// The largest coordinate difference between the vertex and a corner, or little less.
  double reach(std::size_t i) const { return m_lanes.reach[i]; }

  struct Lanes {
    double weights[3][TriangleBatch::kSize], difference[3][TriangleBatch::kSize],
        normal[3][TriangleBatch::kSize];
    double distance[TriangleBatch::kSize], reach[TriangleBatch::kSize];
    double feature[TriangleBatch::kSize];  ///< negative: lanes do not decide it
  };

 private:
  const Eigen::Vector3d& m_p;
  const TriangleBatch& m_triangles;
  alignas(64) Lanes m_lanes;
};

}  // namespace palpate
