#include "Math/RoundSegment.h"

#include <palpate/FeaturePairs.h>

#include "Common/BallTruth.h"
#include "Common/Sanitized.h"
#include "Unit/Math/TrianglePairs.h"

#include <gmpxx.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace palpate::test {
namespace {

using Eigen::Vector3d;

/// How far a point is outside a segment with radii; negative inside.
double outside(const Vector3d& at, const Vector3d& p, const Vector3d& q, double radiusP,
               double radiusQ) {
  using namespace testing;
  return static_cast<double>(roundDistance(wide(at), wide(p), wide(q), radiusP, radiusQ));
}

struct Case {
  RaySegment ray;
  Vector3d p, q;
  double radiusP, radiusQ;
};

/// Rays in every relation to the segment: any, parallel, perpendicular, along its line; with and
/// without a taper, of which some are wider than the segment is long; at sizes that are scaled.
Case makeCase(int kind, Random& random) {
  Case c;
  c.p = random.inCube();
  c.q = kind % 5 == 4 ? c.p : Vector3d(random.inCube());
  c.radiusP = 0.7 * random.unit();
  c.radiusQ = random.below(2) ? c.radiusP : random.below(3) == 0 ? 0.0 : 1.5 * random.unit();
  Vector3d direction = random.inCube();
  const Vector3d u = c.q - c.p;
  if (kind % 5 == 1) direction = (random.below(2) ? 1.7 : -0.6) * u;
  if (kind % 5 == 2) direction = u.cross(direction);
  if (kind % 5 == 3) {
    const int axis = random.below(3);
    c.q = c.p + Vector3d::Unit(axis);
    direction = Vector3d::Unit(random.below(2) ? axis : (axis + 1) % 3);
  }
  Vector3d through = c.p + random.unit() * (c.q - c.p);
  through += 0.7 * random.inCube();
  c.ray = {through - direction, direction, -3.0 + 4.0 * random.unit(), 1.0 + 3.0 * random.unit()};
  return c;
}

void scale(Case& c, int exponent) {
  for (Vector3d* v : {&c.p, &c.q, &c.ray.origin, &c.ray.direction}) *v = scaled(*v, exponent);
  c.radiusP = std::ldexp(c.radiusP, exponent);
  c.radiusQ = std::ldexp(c.radiusQ, exponent);
}

bool isIn(const std::vector<RayInterval>& intervals, double t) {
  return std::any_of(intervals.begin(), intervals.end(),
                     [&](const RayInterval& i) { return i.first <= t && t <= i.last; });
}

/// Compares the intervals with the distance of points of the ray. `size`: the unit of lengths.
template <class Outside>
void checkIntervals(const std::vector<RayInterval>& intervals, const RaySegment& ray, double size,
                    Outside&& distanceOutside) {
  const double margin = 1e-9 * size;
  for (int i = 0; i <= 200; ++i) {
    const double t = ray.tMin + (ray.tMax - ray.tMin) * (i + 0.5) / 201;
    const double distance = distanceOutside(ray.origin + t * ray.direction);
    if (std::abs(distance) > margin) {
      ASSERT_EQ(isIn(intervals, t), distance < 0.0) << t << ' ' << distance;
    }
  }
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    const RayInterval& interval = intervals[i];
    ASSERT_LE(interval.first, interval.last);
    ASSERT_GE(interval.first, ray.tMin);
    ASSERT_LE(interval.last, ray.tMax);
    ASSERT_GT(interval.error, 0.0);
    ASSERT_LT(interval.error, 1e-9 * (1 + size / ray.direction.norm()));
    if (i > 0) {
      ASSERT_GT(interval.first, intervals[i - 1].last);
    }
    // Ends on the surface, or the ray's own. Grazing ends have the root of the rounding error.
    const auto at = [&](double t) {
      return std::abs(distanceOutside(ray.origin + t * ray.direction));
    };
    if (interval.first > ray.tMin) {
      ASSERT_LT(at(interval.first), margin);
    }
    if (interval.last < ray.tMax) {
      ASSERT_LT(at(interval.last), margin);
    }
    ASSERT_EQ(interval.frontFace, interval.first > ray.tMin);
    ASSERT_EQ(interval.crossing, interval.last < ray.tMax ? 1 : 0);
  }
}

TEST(RoundSegment, IntervalsHoldThePointsWithinTheRadius) {
  Random random(1);
  std::size_t none = 0;
  for (int repeat = 0; repeat < testing::casesOf(6000, 2000); ++repeat) {
    Case c = makeCase(repeat, random);
    const int exponent = repeat % 7 == 0 ? random.between(-300, 300) : 0;
    scale(c, exponent);
    const auto found = intersectRay(c.ray, c.p, c.q, c.radiusP, c.radiusQ);
    const std::vector<RayInterval> intervals(found ? 1u : 0u, found.value_or(RayInterval{}));
    none += !found;
    // Distances without overflow: the case at its own size.
    Case unit = c;
    scale(unit, -exponent);
    ASSERT_NO_FATAL_FAILURE(checkIntervals(intervals, unit.ray, 1.0, [&](const Vector3d& at) {
      return outside(at, unit.p, unit.q, unit.radiusP, unit.radiusQ);
    })) << repeat;
  }
  EXPECT_GE(none, testing::leastOf(100, 30));
}

/// The ends are within the stated error where one end's ball holds the rest, however small that is.
TEST(RoundSegment, ErrorsCoverTheLargerRadius) {
  Random random(5);
  for (int repeat = 0; repeat < 3000; ++repeat) {
    const Vector3d q = random.inCube(), u = random.inCube().normalized(),
                   p = q - std::ldexp(0.2, -random.below(40)) * u;
    const double radius = 0.5 + random.unit();
    // The ray stays beyond q along the segment.
    const Vector3d direction = u + 0.5 * random.inCube();
    const RaySegment ray{repeat % 4 < 2 ? q : Vector3d(q + 0.2 * u), direction, 0.0, 100.0};
    const auto found =
        repeat % 2 ? intersectRay(ray, p, q, 0.0, radius) : intersectRay(ray, q, p, radius, 0.0);
    ASSERT_TRUE(found) << repeat;
    // |o + t d - q| = r
    mpf_class a(0, 300), b(0, 300), c(0, 300);
    c = -mpf_class(radius, 300) * radius;
    for (int k = 0; k < 3; ++k) {
      const mpf_class from = mpf_class(ray.origin[k], 300) - q[k], along(direction[k], 300);
      a += along * along;
      b += along * from;
      c += from * from;
    }
    const mpf_class last = (sqrt(mpf_class(b * b - a * c)) - b) / a;
    ASSERT_LE(std::abs(mpf_class(last - found->last).get_d()), found->error) << repeat;
  }
}

/// Rays along lines of a cone's surface, where the quadratic has no square, and through its apex.
TEST(RoundSegment, IntervalsOfRaysAlongACone) {
  Random random(3);
  const Vector3d p(0, 0, 0);
  for (const double narrow : {0.0, 0.25})
    for (const double length : {1.0, 2.0, 0.5})
      for (const Vector3d& along : {Vector3d(1, 1, 0), Vector3d(-1, -1, 0), Vector3d(1, 0, -1),
                                    Vector3d(1, 0.125, 0), Vector3d(1, 3, 0)})
        for (int repeat = 0; repeat < testing::casesOf(21); ++repeat) {
          const Vector3d q(length, 0, 0);
          const double wide = narrow + length;  // an angle of 45 degrees
          Vector3d through = repeat % 3 == 0 ? Vector3d(-narrow, 0, 0) : Vector3d(narrow, 0, 0);
          if (repeat % 3 == 2)
            for (double& x : through) x = 0.25 * random.between(-8, 8);
          const Vector3d direction =
              repeat % 2 ? along : Vector3d{1, 0.4 * random.unit(), 0.4 * random.unit()};
          const RaySegment ray{through - 2.5 * direction, direction, 0.0, 7.25};
          const auto found = intersectRay(ray, p, q, narrow, wide);
          const std::vector<RayInterval> intervals(found ? 1u : 0u, found.value_or(RayInterval{}));
          for (int i = 0; i <= 200; ++i) {
            const double t = ray.tMax * (i + 0.37) / 201,
                         distance = outside(ray.origin + t * direction, p, q, narrow, wide);
            // Near the surface, rounding decides.
            if (std::abs(distance) > 1e-7) {
              ASSERT_EQ(isIn(intervals, t), distance < 0.0) << t << ' ' << distance;
            }
          }
        }
}

TEST(RoundSegment, AnIntervalHoldsThePointsWithinTheRadiusOfATriangle) {
  Random random(2);
  int found = 0;
  for (int repeat = 0; repeat < 6000; ++repeat) {
    Vector3d a = random.inCube(), b = random.inCube(), c = random.inCube();
    Vector3d direction = random.inCube();
    if (repeat % 5 == 1) direction = (b - a).cross(c - a);
    if (repeat % 5 == 2) direction = 0.7 * (b - a) + 0.9 * (c - a);
    if (repeat % 5 == 3) {
      a[2] = b[2] = c[2] = 0.25;
      direction = Vector3d::Unit(random.below(3));
    }
    // Thin triangles, of which some have no area but for rounding.
    if (repeat % 6 == 4) c = a + random.unit() * (b - a);
    if (repeat % 12 == 4) {
      const int exponent = random.between(-50, -5);
      c += std::ldexp(1.0, exponent) * random.inCube();
    }
    if (repeat % 12 == 10) c = random.below(2) ? a : b;
    const double radius = 0.01 + 0.5 * random.unit();
    Vector3d through = repeat % 7 == 0 ? a : pointOn({a, b, c}, random);
    if (repeat % 7 != 0) through += 0.5 * random.inCube();
    const RaySegment ray{through - direction, direction, -3.0 + 4.0 * random.unit(),
                         1.0 + 3.0 * random.unit()};
    // Sizes whose squares leave the range of double.
    const int exponent = repeat % 3 == 0 ? random.between(-900, 900) : 0;
    const auto sized = [&](const Vector3d& at) { return scaled(at, exponent); };
    const RaySegment sizedRay{sized(ray.origin), sized(direction), ray.tMin, ray.tMax};
    const std::optional<RayInterval> interval =
        intersectRay(sizedRay, sized(a), sized(b), sized(c), std::ldexp(radius, exponent));
    found += interval.has_value();
    // Each edge has a capsule in the body.
    const Vector3d edges[][2] = {{a, b}, {b, c}, {c, a}};
    for (const auto& [p, q] : edges) {
      const double sizedRadius = std::ldexp(radius, exponent);
      const auto capsule = intersectRay(sizedRay, sized(p), sized(q), sizedRadius, sizedRadius);
      if (!capsule) continue;
      ASSERT_TRUE(interval) << repeat;
      ASSERT_GE(interval->error, capsule->error) << repeat;
    }
    const std::vector<RayInterval> intervals(interval ? 1 : 0, interval.value_or(RayInterval{}));
    ASSERT_NO_FATAL_FAILURE(checkIntervals(intervals, ray, 1.0, [&](const Vector3d& at) {
      return vertexTriangleDistance(at, a, b, c).distance - radius;
    })) << repeat;
  }
  EXPECT_GT(found, 1000);
}

}  // namespace
}  // namespace palpate::test
