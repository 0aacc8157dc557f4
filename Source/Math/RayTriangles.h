#pragma once

#include "Math/RayTriangle.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>

namespace palpate {

/// Up to eight pairs of a ray and a triangle, each number of a pair side by side.
struct RayTriangles {
  static constexpr std::size_t kSize = 8;
  alignas(64) double origin[3][kSize] = {}, direction[3][kSize] = {}, tMin[kSize] = {},
                     tMax[kSize] = {};
  double corners[3][3][kSize] = {};  ///< corner, axis, pair

  void set(std::size_t i, const RaySegment& ray, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
           const Eigen::Vector3d& c) {
    PALPATE_ASSERT(i < kSize);
    for (int k = 0; k < 3; ++k) {
      origin[k][i] = ray.origin[k];
      direction[k][i] = ray.direction[k];
      corners[0][k][i] = a[k];
      corners[1][k][i] = b[k];
      corners[2][k][i] = c[k];
    }
    tMin[i] = ray.tMin;
    tMax[i] = ray.tMax;
  }
};

/// What intersectRay() returns for each pair, with the same bits. Bits of a mask: pair i.
struct RayTriangleHits {
  alignas(64) double t[RayTriangles::kSize], error[RayTriangles::kSize];
  std::uint32_t hits;       ///< those with an interval, which is [t, t]
  std::uint32_t fronts;     ///< of these, the ones with frontFace and crossing -1; else it is 1
  std::uint32_t undecided;  ///< exact arithmetic has to decide
};
void intersectRays(const RayTriangles&, RayTriangleHits&);

/// What firstPoint() returns for intervals [t, t] of the pairs, with the same bits.
struct RayPoints {
  alignas(64) double t[RayTriangles::kSize], weights[3][RayTriangles::kSize];
  std::uint32_t decided;  ///< the others need firstPoint()
};
/// error: as in RayTriangleHits.
void firstPoints(const RayTriangles&, const double (&t)[RayTriangles::kSize],
                 const double (&error)[RayTriangles::kSize], RayPoints&);

}  // namespace palpate
