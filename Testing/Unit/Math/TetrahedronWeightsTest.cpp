#include "Math/TetrahedronWeights.h"

#include "Common/RandomMeshes.h"
#include "RationalOracle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

using Eigen::Vector3d;
using oracle::Rational;
using testing::Random;

void expectExact(const Vector3d& p, std::array<Vector3d, 4> corners, std::size_t& inside,
                 std::size_t& zeros) {
  SignCounts counts;
  std::array<int, 4> order{0, 1, 2, 3};
  do {
    const std::array<Vector3d, 4> at{corners[order[0]], corners[order[1]], corners[order[2]],
                                     corners[order[3]]};
    const auto expected = oracle::tetrahedronWeights(p, at);
    const auto found = tetrahedronWeights(p, at[0], at[1], at[2], at[3], counts);
    ASSERT_EQ(found.has_value(), expected.has_value());
    if (!found) continue;
    ++inside;
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ((*found)[i] == 0, (*expected)[i] == 0);
      const Rational error = abs(Rational((*found)[i]) - (*expected)[i]);
      EXPECT_TRUE(error <= (*expected)[i] * Rational(0x1p-49));
      zeros += (*found)[i] == 0;
    }
  } while (std::next_permutation(order.begin(), order.end()));
}

TEST(TetrahedronWeights, MatchRationalArithmeticInAnyOrderOfCorners) {
  Random random(1);
  std::size_t inside = 0, zeros = 0;
  for (int run = 0; run < 700; ++run) {
    std::array<Vector3d, 4> corners;
    const bool grid = run % 3 == 0;
    for (Vector3d& c : corners) {
      c = testing::randomPoint(random, -1, 1);
      // On a grid: points on faces, edges and corners, and tetrahedra without volume.
      if (grid) c = (1.49 * c).array().round();
    }
    if (run % 3 == 1) corners[3] = corners[0] + 1e-9 * corners[3];  // needles and slivers
    Vector3d p = testing::randomPoint(random, -1, 1);
    if (grid) p = (1.49 * p).array().round();
    const double weight = testing::uniform(random, 0, 1);
    if (run % 3 == 1) p = weight * corners[0] + (1 - weight) * corners[1];
    if (run % 3 == 2) p = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]) + 0.2 * p;
    expectExact(p, corners, inside, zeros);
  }
  EXPECT_GT(inside, 2500u);
  EXPECT_GT(zeros, 400u);
}

/// Coordinates that do not fit into a grid of 60 bits, and volumes beyond the range of double.
TEST(TetrahedronWeights, AreExactForAnyDoubles) {
  Random random(2);
  std::size_t inside = 0, zeros = 0;
  for (int run = 0; run < 60; ++run) {
    const double size = std::ldexp(1.0, run % 2 ? 900 : -900), tiny = std::ldexp(size, -80);
    const Vector3d away = testing::randomPoint(random, -1, 1) * tiny;
    const std::array<Vector3d, 4> corners{Vector3d(size, 0, 0) + away, Vector3d(0, size, 0),
                                          Vector3d(0, 0, size), -size * Vector3d(1, 1, 1)};
    const Vector3d p = run % 3 == 0   ? Vector3d(0, 0.5 * size, 0.5 * size)
                       : run % 3 == 1 ? Vector3d(tiny * testing::randomPoint(random, -1, 1))
                                      : Vector3d(0, tiny, size);
    expectExact(p, corners, inside, zeros);
  }
  EXPECT_GT(inside, 300u);
  EXPECT_GT(zeros, 300u);
}

}  // namespace
}  // namespace palpate
