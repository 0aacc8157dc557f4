#include "Math/RoundSegment.h"

#include "Common/BallTruth.h"

#include <gtest/gtest.h>

#include <cmath>

// A ray parallel to a line on the cone between two balls meets that cone once.
namespace palpate::test {
namespace {

using Eigen::Vector3d;

TEST(RayAlongCone, IsInWhereItsPointsAre) {
  using namespace testing;
  constexpr double kTriples[][3] = {{3, 4, 5}, {5, 12, 13}, {8, 15, 17}, {7, 24, 25}, {20, 21, 29}};
  int hits = 0;
  for (const auto& [across, along, length] : kTriples)
    for (const double side : {1.0, -1.0})
      for (const double offset : {0.1, 0.5, -0.7}) {
        // The radii change by across / length of the way, as the direction leaves the axis.
        const Vector3d p(0, 0, 0), q(side * length, 0, 0), direction(along, across, 0);
        const double radiusP = side > 0 ? 1.0 : 1.0 + across, radiusQ = radiusP + side * across;
        const RaySegment ray{Vector3d(0, 0.25, 0.25) + offset * q, direction, -4.0, 4.0};
        const auto found = intersectRay(ray, p, q, radiusP, radiusQ);
        for (int i = 0; i <= 400; ++i) {
          const double t = -4.0 + i * 0.02;
          const auto outside = static_cast<double>(
              roundDistance(wide(ray.origin + t * direction), wide(p), wide(q), radiusP, radiusQ));
          if (std::abs(outside) < 1e-6) continue;
          EXPECT_EQ(found && found->first <= t && t <= found->last, outside < 0) << t;
        }
        hits += found.has_value();
      }
  EXPECT_GE(hits, 20);
}

}  // namespace
}  // namespace palpate::test
