#include "Math/RayTriangles.h"

#include "Common/Sanitized.h"
#include "Core/SimdPath.h"
#include "TrianglePairs.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>

// Lanes have the bits of intersectRay() and firstPoint(), and leave to exact arithmetic the same
// pairs.
namespace palpate::test {
namespace {

using Eigen::Vector3d;

struct Pair {
  RaySegment ray;
  Corners corners;
};

bool isSame(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

/// Rays to points of triangles, beside them, and on a grid where many meet edges and corners; of
/// any size and place. Ranges end before, at and behind hits.
Pair nextPair(Random& random, int kind) {
  const bool onGrid = kind % 3 == 0;
  const auto point = [&]() -> Vector3d {
    return onGrid ? random.onGrid(4) : Vector3d(random.inCube());
  };
  Pair pair{{}, cornersOf(point)};
  const auto& [a, b, c] = pair.corners;
  RaySegment& ray = pair.ray;
  ray = {point(), Vector3d::Zero(), 0.0, kind % 4 == 1 ? 1e300 : 1.0};
  const double s = 1.2 * random.unit() - 0.2, t = (1.2 - s) * random.unit() - 0.2;
  ray.direction = onGrid ? Vector3d(point() - ray.origin)
                         : Vector3d(2.0 * (a + s * (b - a) + t * (c - a) - ray.origin));
  if (kind % 5 == 1) ray.tMin = ray.tMax = 0.5;
  if (kind % 5 == 2) ray.tMin = -2.0;
  if (kind % 7 == 1) {  // far away, where differences are rounded
    const Vector3d shift = 1e6 * random.inCube();
    for (Vector3d* p : {&pair.corners[0], &pair.corners[1], &pair.corners[2], &ray.origin})
      *p += shift;
  }
  if (kind % 7 == 2 || kind % 7 == 3) {  // beyond the range of compensated arithmetic
    const double size = kind % 7 == 2 ? 0x1p-120 : 0x1p180;
    for (Vector3d* p : {&pair.corners[0], &pair.corners[1], &pair.corners[2], &ray.origin})
      *p *= size;
    ray.direction *= size;
  }
  if (ray.direction.isZero(0.0)) ray.direction = {0, 0, 1};
  return pair;
}

TEST(RayTriangles, HaveTheBitsOfEachPairOnEverySimdPath) {
  constexpr std::size_t kSize = RayTriangles::kSize;
  for (const std::string& path : simdPaths()) {
    useSimdPath(path);
    Random random(71);
    std::size_t hits = 0, undecided = 0, points = 0;
    for (int i = 0; i < testing::casesOf(20'000); ++i) {
      std::array<Pair, kSize> pairs;
      RayTriangles lanes;
      for (std::size_t k = 0; k < kSize; ++k) {
        pairs[k] = nextPair(random, i + (k % 2 ? 7 : 0));
        const auto& [a, b, c] = pairs[k].corners;
        lanes.set(k, pairs[k].ray, a, b, c);
      }
      RayTriangleHits found;
      intersectRays(lanes, found);
      RayPoints at;
      firstPoints(lanes, found.t, found.error, at);
      for (std::size_t k = 0; k < kSize; ++k) {
        const auto& [ray, corners] = pairs[k];
        const auto& [a, b, c] = corners;
        std::size_t exactDecisions = 0;
        const auto expected = intersectRay(ray, a, b, c, &exactDecisions);
        ASSERT_EQ(found.undecided >> k & 1, exactDecisions) << path << i;
        undecided += exactDecisions;
        if (exactDecisions) continue;
        ASSERT_EQ((found.hits >> k & 1) != 0, expected.has_value()) << path << i;
        if (!expected) continue;
        ++hits;
        ASSERT_TRUE(isSame(found.t[k], expected->first)) << path << i;
        ASSERT_TRUE(isSame(found.t[k], expected->last)) << path << i;
        ASSERT_TRUE(isSame(found.error[k], expected->error)) << path << i;
        ASSERT_EQ((found.fronts >> k & 1) != 0, expected->frontFace) << path << i;
        ASSERT_EQ(expected->crossing, expected->frontFace ? -1 : 1) << path << i;
        if (!(at.decided >> k & 1)) continue;
        ++points;
        const RayPoint point = firstPoint(ray, *expected, a, b, c);
        ASSERT_TRUE(isSame(at.t[k], point.t)) << path << i;
        for (int j = 0; j < 3; ++j) ASSERT_TRUE(isSame(at.weights[j][k], point.weights[j]));
      }
    }
    EXPECT_GE(hits, testing::leastOf(20'000)) << path;
    EXPECT_GE(undecided, testing::leastOf(1'000)) << path;
    EXPECT_GE(2 * points, hits) << path;  // a third is beyond the range
  }
  useSimdPath("");
}

}  // namespace
}  // namespace palpate::test
