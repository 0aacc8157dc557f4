#include "Math/TranslationExit.h"

#include "Common/RandomMeshes.h"

#include <palpate/FeaturePairs.h>

#include <gtest/gtest.h>

#include <cmath>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

Corners randomTriangle(Random& random) {
  return {randomPoint(random, -1, 1), randomPoint(random, -1, 1), randomPoint(random, -1, 1)};
}

bool intersectAt(const Corners& a, const Corners& b, const Vector3d& shift) {
  return trianglesIntersect(a[0] + shift, a[1] + shift, a[2] + shift, b[0], b[1], b[2]);
}

Vector3d at(const Corners& corners, const Vector3d& weights) {
  return weights[0] * corners[0] + weights[1] * corners[1] + weights[2] * corners[2];
}

TEST(TranslationExit, TrianglesIntersectUntilTheLastTouchAndNotBeyond) {
  Random random(1);
  int intersecting = 0;
  for (int i = 0; i < 3000; ++i) {
    const Corners a = randomTriangle(random), b = randomTriangle(random);
    const Vector3d direction = randomPoint(random, -1, 1).normalized();
    if (!intersectAt(a, b, Vector3d::Zero())) continue;
    ++intersecting;
    const TranslationExit exit = lastTouch(a, b, direction);
    ASSERT_GE(exit.t, 0.0);
    for (const double share : {0.3, 0.7, 1 - 1e-7})
      EXPECT_TRUE(intersectAt(a, b, share * exit.t * direction));
    EXPECT_FALSE(intersectAt(a, b, (exit.t + 1e-7) * direction));
    const Vector3d pointA = at(a, exit.weightsA) + exit.t * direction,
                   pointB = at(b, exit.weightsB);
    EXPECT_LE((pointA - pointB).norm(), 1e-8 * (1 + exit.t));
    EXPECT_NEAR(exit.weightsA.sum(), 1.0, 1e-12);
    EXPECT_NEAR(exit.weightsB.sum(), 1.0, 1e-12);
    EXPECT_NEAR(exit.normal.norm(), 1.0, 1e-9);
    EXPECT_GE(exit.normal.dot(direction), 0.0);
  }
  EXPECT_GT(intersecting, 300);
}

TEST(TranslationExit, NamesTheFeaturesThatTouchLast) {
  const Corners floor{Vector3d(-4, -4, 0), Vector3d(4, -4, 0), Vector3d(0, 4, 0)},
      tip{Vector3d(0, 0, -0.5), Vector3d(-1, 0, 1), Vector3d(1, 0, 1)};
  const TranslationExit up = lastTouch(tip, floor, Vector3d::UnitZ());
  EXPECT_DOUBLE_EQ(up.t, 0.5);
  EXPECT_EQ(up.weightsA, Vector3d::UnitX());
  EXPECT_EQ(up.normal, Vector3d::UnitZ());
  const TranslationExit down = lastTouch(tip, floor, -Vector3d::UnitZ());
  EXPECT_DOUBLE_EQ(down.t, 1.0);
  EXPECT_EQ(down.normal, -Vector3d::UnitZ());
}

TEST(TranslationExit, TrianglesThatNeverMeetHaveNone) {
  const Corners a{Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0)},
      b{Vector3d(5, 5, 1), Vector3d(6, 5, 1), Vector3d(5, 6, 1)};
  EXPECT_TRUE(std::isinf(lastTouch(a, b, Vector3d::UnitZ()).t));
}

}  // namespace
}  // namespace palpate::testing
