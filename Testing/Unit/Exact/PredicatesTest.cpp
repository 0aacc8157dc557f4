#include "Exact/Exact.h"
#include "Exact/ExactSum.h"
#include "Exact/Predicates.h"
#include "Common/Sanitized.h"
#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <vector>

namespace palpate::test {
namespace {

/// The determinant, expanded without differences, in integers. It shares no code with the
/// predicates.
int volumeSign(const std::array<Eigen::Vector3d, 4>& p) {
  std::array<std::array<Integer, 3>, 4> q;
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 3; ++k) q[i][k] = scaledInteger(p[i][k]);
  const auto triple = [&](int i, int j, int k) -> Integer {
    return q[i][0] * q[j][1] * q[k][2] + q[i][1] * q[j][2] * q[k][0] + q[i][2] * q[j][0] * q[k][1] -
           q[i][2] * q[j][1] * q[k][0] - q[i][0] * q[j][2] * q[k][1] - q[i][1] * q[j][0] * q[k][2];
  };
  return sgn(Integer(triple(1, 2, 3) - triple(0, 2, 3) + triple(0, 1, 3) - triple(0, 1, 2)));
}

int areaSign(int axis, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
             const Eigen::Vector3d& c) {
  const int x = (axis + 1) % 3, y = (axis + 2) % 3;
  const auto cross = [&](const Eigen::Vector3d& p, const Eigen::Vector3d& q) -> Integer {
    return scaledInteger(p[x]) * scaledInteger(q[y]) - scaledInteger(p[y]) * scaledInteger(q[x]);
  };
  return sgn(Integer(cross(a, b) + cross(b, c) + cross(c, a)));
}

TEST(Predicates, EverySignMatchesTheIntegerDeterminant) {
  Random random(1);
  SignCounts counts;
  for (int k = 0; k < static_cast<int>(Kind::Count); ++k) {
    for (int repeat = 0; repeat < testing::casesOf(1500); ++repeat) {
      const auto [a, b] = makePair(static_cast<Kind>(k), random);
      ASSERT_EQ(orient3d(a[0], a[1], a[2], b[0], counts), volumeSign({a[0], a[1], a[2], b[0]}))
          << k;
      ASSERT_EQ(orient3d(a[0], b[1], a[2], b[0], counts), volumeSign({a[0], b[1], a[2], b[0]}))
          << k;
      for (int axis = 0; axis < 3; ++axis)
        ASSERT_EQ(orient2d(axis, a[0], a[1], b[0], counts), areaSign(axis, a[0], a[1], b[0])) << k;
    }
  }
  EXPECT_GE(counts.undecided, testing::leastOf(10000));
}

Eigen::Vector3d nudged(Eigen::Vector3d p, int axis, Random& random) {
  const double infinity = std::numeric_limits<double>::infinity();
  p[axis] = std::nextafter(p[axis], random.below(2) ? infinity : -infinity);
  return p;
}

TEST(Predicates, OneUlpOffThePlaneOrTheLineIsDetected) {
  Random random(2);
  SignCounts counts;
  for (int repeat = 0; repeat < 5000; ++repeat) {
    const Eigen::Vector3d a = random.inCube(), b = random.inCube(), c = random.inCube();
    const int axis = random.below(3);
    const Eigen::Vector3d d = nudged(pointOn({a, b, c}, random), axis, random);
    ASSERT_EQ(orient3d(a, b, c, d, counts), volumeSign({a, b, c, d}));
    const Eigen::Vector3d e = nudged(a + random.unit() * (b - a), axis, random);
    for (int along = 0; along < 3; ++along)
      ASSERT_EQ(orient2d(along, a, b, e, counts), areaSign(along, a, b, e));
  }
}

/// Products that end among the denormals, and all around.
TEST(Predicates, UnderflowDoesNotFlipAVolume) {
  Random random(5);
  SignCounts counts;
  for (int exponent = -1020; exponent <= 1000;
       exponent += std::abs(exponent + 450) < 120 ? 1 : 30) {
    for (int repeat = 0; repeat < testing::casesOf(60); ++repeat) {
      CornersPair pair{cornersOf([&] { return random.inCube(); }), {}};
      pair.second = cornersOf([&] { return pointOn(pair.first, random); });
      const auto [a, b] = scaled(pair, exponent);
      ASSERT_EQ(orient3d(a[0], a[1], a[2], b[0], counts), volumeSign({a[0], a[1], a[2], b[0]}))
          << exponent;
    }
  }
}

/// Products that round to multiples of the least double, of differences that are rounded
/// themselves. The relative error alone is no bound.
TEST(Predicates, UnderflowDoesNotFlipAnAreaOfRoundedDifferences) {
  Random random(7);
  SignCounts counts;
  const auto uneven = [&] {
    Eigen::Vector3d p = random.inCube();
    for (double& x : p) x = std::ldexp(x, -random.below(8));
    return p;
  };
  for (int exponent = -545; exponent <= -490; ++exponent) {
    for (int repeat = 0; repeat < testing::casesOf(std::abs(exponent + 511) < 6 ? 6000 : 1500);
         ++repeat) {
      const Eigen::Vector3d a = scaled(uneven(), exponent), b = scaled(uneven(), exponent);
      const Eigen::Vector3d c = a + random.unit() * (b - a);
      ASSERT_EQ(orient2d(repeat % 3, a, b, c, counts), areaSign(repeat % 3, a, b, c)) << exponent;
    }
  }
}

TEST(Predicates, FloatingPointFilterDecidesNonDegenerateInput) {
  Random random(4);
  SignCounts counts;
  for (int repeat = 0; repeat < 100000; ++repeat) {
    const auto [a, b] = makePair(Kind::Random, random);
    orient3d(a[0], a[1], a[2], b[0], counts);
    orient2d(repeat % 3, a[0], a[1], a[2], counts);
  }
  EXPECT_EQ(counts.undecided, 0u);
}

/// Positions that are equal or flat along an axis: no arithmetic is needed, so that exact
/// arithmetic is not counted.
TEST(Predicates, TrivialZerosAreNotCounted) {
  Random random(9);
  SignCounts counts;
  for (int repeat = 0; repeat < 500; ++repeat) {
    std::array<Eigen::Vector3d, 4> p{random.inCube(), random.inCube(), random.inCube(),
                                     random.inCube()};
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < i; ++j) {
        std::array<Eigen::Vector3d, 4> q = p;
        q[i] = q[j];
        ASSERT_EQ(orient3d(q[0], q[1], q[2], q[3], counts), 0);
      }
    for (int axis = 0; axis < 3; ++axis) {
      std::array<Eigen::Vector3d, 4> q = p;
      for (Eigen::Vector3d& at : q) at[axis] = 0.25;
      ASSERT_EQ(orient3d(q[0], q[1], q[2], q[3], counts), 0);
      for (int other = 0; other < 3; ++other)
        if (other != axis) {
          ASSERT_EQ(orient2d(other, q[0], q[1], q[2], counts), 0);
        }
    }
  }
  EXPECT_EQ(counts.undecided, 0u);
}

/// All exponents, with carries through many words, and back to zero in another order.
TEST(ExactSum, HasTheSignOfTheIntegerSum) {
  Random random(8);
  const double largest = std::numeric_limits<double>::max();
  const auto anyDouble = [&](int exponent) {
    const double x = random.below(8) == 0 ? 1.0 : 0.5 + random.unit() / 2;
    return (random.below(2) ? x : -x) * std::ldexp(1.0, exponent);
  };
  int zeros = 0;
  for (int repeat = 0; repeat < 20000; ++repeat) {
    std::vector<std::array<double, 3>> products;
    const int exponent = random.between(-1074, 1023);
    for (int i = random.between(1, 6); i > 0; --i) {
      const bool anywhere = random.below(3) == 0;
      std::array<double, 3> product;
      for (double& x : product) x = anyDouble(anywhere ? random.between(-1074, 1023) : exponent);
      if (random.below(20) == 0) product.fill(largest);
      products.push_back(product);
      if (random.below(2)) products.push_back({product[1], product[2], -product[0]});
    }
    ExactSum sum;
    Integer truth = 0;
    for (const auto& [x, y, z] : products) {
      const bool negative = random.below(2);
      sum.add(x, y, z, negative);
      const Integer product = scaledInteger(x) * scaledInteger(y) * scaledInteger(z);
      truth += negative ? Integer(-product) : product;
      ASSERT_EQ(sum.sign(), sgn(truth)) << repeat;
    }
    zeros += truth == 0;
  }
  EXPECT_GT(zeros, 500);
}

TEST(Exact, ScaledIntegersKeepTheirOrder) {
  const double denormal = std::numeric_limits<double>::denorm_min();
  EXPECT_TRUE(scaledInteger(denormal) == 1);
  EXPECT_TRUE(scaledInteger(-3 * denormal) == -3);
  EXPECT_TRUE(scaledInteger(-0.0) == 0);
  EXPECT_TRUE(scaledInteger(0x1p-1022) == Integer(1) << 52);
  EXPECT_TRUE(scaledInteger(1.5) == Integer(3) << 1073);
  EXPECT_TRUE(scaledInteger(std::numeric_limits<double>::max()) == ((Integer(1) << 53) - 1)
                                                                       << 2045);
}

}  // namespace
}  // namespace palpate::test
