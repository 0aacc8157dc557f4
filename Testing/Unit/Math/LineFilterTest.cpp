#include "Math/RayTriangle.h"

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

// The filter never misses a triangle that intersectRay() meets, and finds most others.
namespace palpate {
namespace {

using Eigen::Vector3d;
using testing::Random;
using testing::randomPoint;

struct Line {
  Vector3d origin, direction;
};

bool meets(const Line& line, const std::array<Vector3d, 3>& corners) {
  return intersectRay({line.origin, line.direction, -1e30, 1e30}, corners[0], corners[1],
                      corners[2])
      .has_value();
}

/// The filter for a line, of which each coordinate may be off by `error`.
LineFilter filterOf(const Line& line, const std::array<Vector3d, 3>& corners, double error) {
  Eigen::Index axis;
  const double length = line.direction.cwiseAbs().maxCoeff(&axis);
  double extent = 0.0;
  for (const Vector3d& corner : corners)
    extent = std::max(extent, (corner - line.origin).cwiseAbs().maxCoeff());
  return {line.origin, line.direction / length, static_cast<int>(axis), extent,
          error + 0x1p-46 * extent};
}

bool misses(const LineFilter& filter, const std::array<Vector3d, 3>& corners) {
  return filter.misses(corners[0], corners[1], corners[2]);
}

TEST(LineFilter, NeverMissesATriangleThatTheLineMeets) {
  Random random(77);
  std::size_t met = 0, missed = 0, found = 0;
  for (int i = 0; i < 20000; ++i) {
    std::array<Vector3d, 3> t{randomPoint(random, -1, 1), randomPoint(random, -1, 1),
                              randomPoint(random, -1, 1)};
    if (i % 5 == 0) t[2] = t[1];                 // a segment
    if (i % 7 == 0) t[2] = 0.5 * (t[0] + t[1]);  // without area, but for rounding
    if (i % 11 == 0) t[1] = t[0] + 1e-9 * t[1];
    const double s = testing::uniform(random, 0, 1);
    const Vector3d onEdge = (1 - s) * t[0] + s * t[1],
                   through[] = {t[0], 0.5 * (t[0] + t[1]), onEdge, (1 - s) * onEdge + s * t[2],
                                randomPoint(random, -1, 1)};
    Line line{through[i % 5], randomPoint(random, -1, 1)};
    if (i % 3 == 0) line.direction = Vector3d::Unit(i % 9 / 3);
    if (i % 13 == 0) line.direction = t[1] - t[0];
    if (line.direction == Vector3d::Zero()) continue;
    line.origin -= std::ldexp(1.0, static_cast<int>(random() % 20) - 10) * line.direction;
    const bool isMet = meets(line, t), isMissed = misses(filterOf(line, t, 0.0), t);
    met += isMet;
    if (i % 5 == 4) {  // not beside an edge
      missed += !isMet;
      found += isMissed;
    }
    for (const double scale : {1.0, 0x1p-520, 0x1p-300, 0x1p90, 0x1p300}) {
      std::array<Vector3d, 3> at;
      for (std::size_t k = 0; k < 3; ++k) at[k] = scale * t[k];
      const Line scaled{scale * line.origin, line.direction};
      EXPECT_FALSE(isMet && misses(filterOf(scaled, at, 0.0), at)) << i << ' ' << scale;
    }
  }
  EXPECT_GT(met, 5000u);
  EXPECT_GT(missed, 2000u);
  EXPECT_GT(found, missed * 9 / 10);
}

TEST(LineFilter, KeepsItsErrorWhereTheLineIsOff) {
  Random random(78);
  const double error = 1e-3;
  std::size_t kept = 0;
  for (int i = 0; i < 20000; ++i) {
    const std::array<Vector3d, 3> t{randomPoint(random, -1, 1), randomPoint(random, -1, 1),
                                    randomPoint(random, -1, 1)};
    const Line line{randomPoint(random, -1, 1), randomPoint(random, -1, 1)};
    if (line.direction == Vector3d::Zero() || !meets(line, t)) continue;
    const Line off{line.origin + randomPoint(random, -error, error), line.direction};
    EXPECT_FALSE(misses(filterOf(off, t, error), t)) << i;
    ++kept;
  }
  EXPECT_GT(kept, 1000u);
}

TEST(LineFilter, FindsNothingUnlessItIsMade) {
  EXPECT_FALSE(LineFilter().misses({1, 1, 0}, {2, 1, 0}, {1, 2, 0}));
}

}  // namespace
}  // namespace palpate
