#include "Math/RayTriangle.h"

#include "Common/EverySimdPath.h"
#include "Common/Sanitized.h"
#include "Math/RayTriangles.h"
#include "Math/Tolerances.h"
#include "RationalOracle.h"
#include "TrianglePairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

// Intersections of rays and triangles, beside those in rational numbers.

namespace palpate::test {
namespace {

using oracle::Rational;

/// Of the ray's own range.
std::optional<oracle::Range> sharedByRay(const RaySegment& ray, const Corners& corners) {
  auto range = oracle::lineOn(oracle::toRational(ray.origin), oracle::toRational(ray.direction),
                              {oracle::toRational(corners[0]), oracle::toRational(corners[1]),
                               oracle::toRational(corners[2])});
  if (!range || !range->cut(-Rational(ray.tMin), 1) || !range->cut(Rational(ray.tMax), -1))
    return {};
  return range;
}

void expectShared(const RaySegment& ray, const Corners& t, int& hits) {
  const std::optional<oracle::Range> truth = sharedByRay(ray, t);
  const std::optional<RayInterval> found = intersectRay(ray, t[0], t[1], t[2]);
  ASSERT_EQ(found.has_value(), truth.has_value());
  if (!truth) return;
  ++hits;
  const Rational error(found->error);
  EXPECT_TRUE(abs(truth->first - Rational(found->first)) <= error);
  EXPECT_TRUE(abs(truth->last - Rational(found->last)) <= error);
}

/// Small integers: many rays lie in the triangle's plane or along its edges, and many triangles
/// have no area.
TEST(RayTriangle, AgreesWithRationalArithmeticOnSmallGrids) {
  Random random(31);
  int hits = 0;
  for (int i = 0; i < testing::casesOf(20000) && !::testing::Test::HasFailure(); ++i) {
    const int size = 2 + i % 3;
    Corners t = cornersOf([&] { return random.onGrid(size); });
    Eigen::Vector3d origin = random.onGrid(size), direction = random.onGrid(size);
    direction -= random.onGrid(size);
    if (i % 2)
      for (Eigen::Vector3d* v : {&t[0], &t[1], &t[2], &origin}) v->z() = 1.0;
    if (i % 2) direction.z() = 0.0;
    if (direction.isZero(0.0)) continue;
    const RaySegment ray{origin, direction, 0.25 * random.between(-6, 4),
                         0.25 * random.between(4, 8)};
    SCOPED_TRACE(i);
    expectShared(ray, t, hits);
  }
  EXPECT_GE(hits, static_cast<int>(testing::leastOf(2000)));
}

/// Rays through edges and corners, and rays that begin or end on the triangle, up to rounding.
TEST(RayTriangle, AgreesWithRationalArithmeticNearBorders) {
  Random random(32);
  int hits = 0;
  const int cases = testing::casesOf(6000);
  for (int i = 0; i < cases && !::testing::Test::HasFailure(); ++i) {
    Corners t = cornersOf([&] { return random.inCube(); });
    if (i % 5 == 0)
      for (Eigen::Vector3d& corner : t) corner += Eigen::Vector3d(1e4, -2e5, 3e3);
    const int from = random.below(3);
    const Eigen::Vector3d &a = t[static_cast<std::size_t>(from)],
                          &b = t[static_cast<std::size_t>((from + 1) % 3)];
    const Eigen::Vector3d through =
        i % 4 < 2
            ? Eigen::Vector3d(a + (random.below(4) ? random.unit() : random.below(2)) * (b - a))
            : pointOn(t, random);
    const Eigen::Vector3d origin = through + random.inCube();
    RaySegment ray{origin, through - origin, -10.0, 10.0};
    if (i % 4 >= 2) {
      const std::optional<RayInterval> whole = intersectRay(ray, t[0], t[1], t[2]);
      if (!whole) continue;
      double end = whole->first;
      for (int k = random.below(3); k > 0; --k)
        end = std::nextafter(end, random.below(2) ? 10.0 : -10.0);
      (random.below(2) ? ray.tMin : ray.tMax) = end;
    }
    SCOPED_TRACE(i);
    expectShared(ray, t, hits);
  }
  EXPECT_GT(hits, cases / 4);
  EXPECT_LT(hits, cases * 3 / 4);
}

/// Rays that are nearly in the triangle's plane, and sizes that are not moderate.
TEST(RayTriangle, FirstPointsAreWithinTheStatedError) {
  Random random(33);
  int hits = 0;
  for (int i = 0; i < testing::casesOf(8000); ++i) {
    constexpr int kExponents[] = {0, 0, 150, -150, 280, -280};
    const int exponent = kExponents[i % 6];
    Corners t = cornersOf([&] { return random.inCube(); });
    const Eigen::Vector3d inPlane = (t[1] - t[0]) + random.unit() * (t[2] - t[0]);
    const double aside = std::ldexp(1.0, -random.below(45));
    const Eigen::Vector3d direction = inPlane + aside * random.inCube(), on = pointOn(t, random),
                          origin = on - (0.2 + random.unit()) * direction;
    for (Eigen::Vector3d& corner : t) corner = scaled(corner, exponent);
    const RaySegment ray{scaled(origin, exponent), scaled(direction, exponent), -4.0, 4.0};
    const std::optional<RayInterval> found = intersectRay(ray, t[0], t[1], t[2]);
    if (!found) continue;
    ++hits;
    const std::optional<oracle::Range> truth = sharedByRay(ray, t);
    ASSERT_TRUE(truth) << i;
    const RayPoint point = firstPoint(ray, *found, t[0], t[1], t[2]);
    double extent = 0.0;
    for (const Eigen::Vector3d& corner : t)
      extent = std::max(extent, (corner - ray.origin).cwiseAbs().maxCoeff());
    const double most = extent / ray.direction.cwiseAbs().maxCoeff();
    const Rational error = abs(truth->first - Rational(point.t));
    ASSERT_LE(error.get_d(), kRayError * most) << i;
    const Eigen::Vector3d& w = point.weights;
    ASSERT_GE(w.minCoeff(), 0.0) << i;
    ASSERT_NEAR(w.sum(), 1.0, 0x1p-52) << i;
    const Eigen::Vector3d away =
        w[0] * t[0] + w[1] * t[1] + w[2] * t[2] - (ray.origin + point.t * ray.direction);
    ASSERT_LE(away.cwiseAbs().maxCoeff(), 0x1p-44 * extent) << i;
  }
  EXPECT_GE(hits, static_cast<int>(testing::leastOf(4000)));
}

// ---- Several at once ----

// Lanes have the bits of intersectRay() and firstPoint(), and leave to exact arithmetic the same
// pairs.

struct RayPair {
  RaySegment ray;
  Corners corners;
};

bool isSame(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

/// Rays to points of triangles, beside them, and on a grid where many meet edges and corners; of
/// any size and place. Ranges end before, at and behind hits.
RayPair nextPair(Random& random, int kind) {
  const bool onGrid = kind % 3 == 0;
  const auto point = [&]() -> Eigen::Vector3d {
    return onGrid ? random.onGrid(4) : Eigen::Vector3d(random.inCube());
  };
  RayPair pair{{}, cornersOf(point)};
  const auto& [a, b, c] = pair.corners;
  RaySegment& ray = pair.ray;
  ray = {point(), Eigen::Vector3d::Zero(), 0.0, kind % 4 == 1 ? 1e300 : 1.0};
  const double s = 1.2 * random.unit() - 0.2, t = (1.2 - s) * random.unit() - 0.2;
  ray.direction = onGrid ? Eigen::Vector3d(point() - ray.origin)
                         : Eigen::Vector3d(2.0 * (a + s * (b - a) + t * (c - a) - ray.origin));
  if (kind % 5 == 1) ray.tMin = ray.tMax = 0.5;
  if (kind % 5 == 2) ray.tMin = -2.0;
  if (kind % 7 == 1) {  // far away, where differences are rounded
    const Eigen::Vector3d shift = 1e6 * random.inCube();
    for (Eigen::Vector3d* p : {&pair.corners[0], &pair.corners[1], &pair.corners[2], &ray.origin})
      *p += shift;
  }
  if (kind % 7 == 2 || kind % 7 == 3) {  // beyond the range of compensated arithmetic
    const double size = kind % 7 == 2 ? 0x1p-120 : 0x1p180;
    for (Eigen::Vector3d* p : {&pair.corners[0], &pair.corners[1], &pair.corners[2], &ray.origin})
      *p *= size;
    ray.direction *= size;
  }
  if (ray.direction.isZero(0.0)) ray.direction = {0, 0, 1};
  return pair;
}

TEST(RayTriangles, HaveTheBitsOfEachPairOnEverySimdPath) {
  constexpr std::size_t kSize = RayTriangles::kSize;
  for (const std::string& path : testing::EverySimdPath()) {
    Random random(71);
    std::size_t hits = 0, undecided = 0, points = 0;
    for (int i = 0; i < testing::casesOf(20'000); ++i) {
      std::array<RayPair, kSize> pairs;
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
}

}  // namespace
}  // namespace palpate::test
