#include "Math/RayTriangle.h"

#include "Common/Sanitized.h"
#include "Math/Tolerances.h"
#include "RationalOracle.h"
#include "TrianglePairs.h"

#include <gtest/gtest.h>

#include <algorithm>
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

}  // namespace
}  // namespace palpate::test
