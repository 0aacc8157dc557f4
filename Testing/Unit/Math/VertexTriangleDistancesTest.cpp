#include "Math/VertexTriangleDistances.h"

#include "Common/EverySimdPath.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "DistanceCases.h"
#include "Math/ClosestPoint.h"
#include "Math/DistanceBounds.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>

// Lanes have the bits of finiteVertexTriangleDistance().
namespace palpate {
namespace {

using Eigen::Vector3d;
using oracle::DistanceCases, oracle::DistanceKind, oracle::Four;

bool isSame(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}
bool isSame(const Vector3d& a, const Vector3d& b) {
  return isSame(a[0], b[0]) && isSame(a[1], b[1]) && isSame(a[2], b[2]);
}

TEST(VertexTriangleDistances, HaveTheBitsOfEachDistanceOnEverySimdPath) {
  for (const std::string& path : testing::EverySimdPath()) {
    DistanceCases cases(21);
    for (int i = 0; i < testing::casesOf(8'000); ++i) {
      const std::size_t count = 1 + i % TriangleBatch::kSize;
      std::array<Four, TriangleBatch::kSize> x;
      TriangleBatch batch;
      for (std::size_t k = 0; k < count; ++k) {
        x[k] = cases.next(static_cast<DistanceKind>(i / 10 % oracle::kDistanceKinds));
        batch.set(k, x[k][1], x[k][2], x[k][3]);
      }
      const Vector3d p = x[0][0];
      const VertexTriangleDistances lanes(p, batch, count);
      for (std::size_t k = 0; k < count; ++k) {
        const VertexTriangleDistance expected =
            finiteVertexTriangleDistance(p, x[k][1], x[k][2], x[k][3]);
        const VertexTriangleDistance found = lanes[k];
        ASSERT_EQ(found.feature, expected.feature) << path << i;
        ASSERT_TRUE(isSame(found.weights, expected.weights)) << path << i;
        ASSERT_TRUE(isSame(found.difference, expected.difference)) << path << i;
        ASSERT_TRUE(isSame(found.normal, expected.normal)) << path << i;
        ASSERT_TRUE(isSame(found.distance, expected.distance)) << path << i;
      }
    }
  }
}

/// Triangles of any shape: with narrow angles, tiny, and without area.
TriangleBatch batchOfTriangles(testing::Random& random) {
  TriangleBatch batch;
  for (std::size_t i = 0; i < TriangleBatch::kSize; ++i) {
    const double length = std::pow(10.0, testing::uniform(random, -8, 0)),
                 width = std::pow(10.0, testing::uniform(random, -12, 0));
    const Vector3d a = testing::randomPoint(random, -1, 1),
                   b = a + length * testing::randomPoint(random, -1, 1),
                   along = testing::uniform(random, -1, 2) * (b - a);
    batch.set(i, a, b, a + along + width * length * testing::randomPoint(random, -1, 1));
  }
  return batch;
}

TEST(DistanceBounds, EncloseTheDistanceOnEveryPath) {
  for (const std::string& path : testing::EverySimdPath()) {
    testing::Random random(1);
    for (int i = 0; i < testing::casesOf(5000); ++i) {
      const TriangleBatch batch = batchOfTriangles(random);
      Vector3d p = testing::randomPoint(random, -2, 2);
      if (i % 3 == 0) p = 0.5 * (batch.corner(0, 0) + batch.corner(0, 1));
      if (i % 7 == 0) p = batch.corner(1, 2);
      const DistanceBounds bounds(p, batch, TriangleBatch::kSize);
      const VertexTriangleDistances exact(p, batch, TriangleBatch::kSize);
      for (std::size_t k = 0; k < TriangleBatch::kSize; ++k) {
        const double distance = exact[k].distance;
        ASSERT_LE(bounds.lower[k], distance) << path;
        ASSERT_LE(distance, bounds.distance[k] + bounds.error[k]) << path;
      }
    }
  }
}

}  // namespace
}  // namespace palpate
