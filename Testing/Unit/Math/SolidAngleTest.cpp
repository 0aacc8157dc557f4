#include "Math/SolidAngle.h"

#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

namespace palpate::test {
namespace {

using Eigen::Vector3d;
using Extended = Eigen::Matrix<long double, 3, 1>;

long double shareOf(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const auto from = [&](const Vector3d& to) -> Extended {
    return (to.cast<long double>() - p.cast<long double>()).normalized();
  };
  const Extended u = from(a), v = from(b), w = from(c);
  return std::atan2(u.dot(v.cross(w)), 1 + u.dot(v) + v.dot(w) + w.dot(u)) /
         (2 * std::numbers::pi_v<long double>);
}

TEST(SolidAngle, SharesAreWithinTheirErrorAndAtMostHalf) {
  Random random(1);
  for (int repeat = 0; repeat < 20000; ++repeat) {
    const Vector3d a = random.inCube(), b = random.inCube(), c = random.inCube();
    Vector3d p = random.inCube();
    // Near the triangle, its border and its plane.
    if (repeat % 4 == 1) p = 1e-12 * p + pointOn({a, b, c}, random);
    if (repeat % 4 == 2) p = 1e-9 * p + a + random.unit() * (b - a);
    const SolidAngleShare share = solidAngleShare(p, a, b, c);
    ASSERT_LE(std::abs(share.value), 0.5);
    const auto off = static_cast<double>(std::abs(share.value - shareOf(p, a, b, c)));
    // At the half the sign is open: either is the whole of a sphere away.
    ASSERT_LE(std::min(off, 1 - off), share.error) << repeat;
    if (repeat % 4 == 0) {
      ASSERT_LT(share.error, 1e-9);
      ASSERT_NEAR(solidAngleShare(p, b, c, a).value, share.value, 2 * share.error);
      ASSERT_NEAR(solidAngleShare(p, b, a, c).value, -share.value, 2 * share.error);
    }
  }
}

TEST(SolidAngle, AClosedSurfaceCoversAllDirectionsFromInsideOnly) {
  Random random(2);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const std::array<Vector3d, 4> at{random.inCube(), random.inCube(), random.inCube(),
                                     random.inCube()};
    const int exponent = repeat % 5 == 0 ? random.between(-700, 700) : 0;
    const auto position = [&](int i) { return scaled(at[static_cast<std::size_t>(i)], exponent); };
    const double volume = (at[1] - at[0]).cross(at[2] - at[0]).dot(at[3] - at[0]);
    if (std::abs(volume) < 1e-3) continue;
    const Vector3d middle = (at[0] + at[1] + at[2] + at[3]) / 4;
    for (const bool inside : {true, false}) {
      const Vector3d p = scaled(inside ? middle : Vector3d(4 * at[0] - 3 * middle), exponent);
      SolidAngleShare sum;
      constexpr int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
      for (const auto& f : faces)
        sum.add(solidAngleShare(p, position(f[0]), position(f[1]), position(f[2])));
      const double truth = !inside ? 0.0 : volume > 0 ? 1.0 : -1.0;
      ASSERT_LE(std::abs(sum.value - truth), sum.error) << repeat;
      ASSERT_LT(sum.error, 1e-9);
      ASSERT_GT(sum.error, 0.0);
    }
  }
}

TEST(SolidAngle, APointOnTheTriangleHasNoKnownShare) {
  const Vector3d a(0, 0, 0), b(1, 0, 0), c(0, 1, 0);
  EXPECT_EQ(solidAngleShare({0.5, 0, 0}, a, b, c).error, 1.0);  // on an edge
  EXPECT_EQ(solidAngleShare(b, a, b, c).error, 1.0);
  EXPECT_EQ(solidAngleShare({0.25, 0.25, 0}, a, b, c).error, 0.5);
  EXPECT_NEAR(solidAngleShare({0, 0, -1e-9}, {-1, -1, 0}, {2, -1, 0}, {0, 3, 0}).value, 0.5, 1e-6);
}

}  // namespace
}  // namespace palpate::test
