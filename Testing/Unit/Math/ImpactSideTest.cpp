#include "ImpactCases.h"

#include <gtest/gtest.h>

#include <cmath>

namespace palpate {

namespace {

/// Edge p along x comes down (side 1) or up on edge q, turned by the angle against it; both are
/// `length` long. Their cross product points down.
ImpactCase crossing(double angle, double side, double length) {
  const double height = 0.01 * side;
  const Eigen::Vector3d p0(-0.3, 0, 0), p1(length, 0, 0), q0(-0.3, -0.3 * std::sin(angle), 0),
      q1(length, length * std::sin(angle), 0), up(0, 0, height);
  return {true, {p0 + up, p1 + up, q1, q0, p0 - up, p1 - up, q1, q0}};
}

TEST(ImpactSide, IsCorrectForNearlyParallelEdges) {
  for (const double side : {1.0, -1.0})
    for (int exponent = 0; exponent <= 300; ++exponent) {
      const ImpactCase query = crossing(std::pow(10.0, -exponent), side, 0.7);
      ASSERT_EQ(sideBefore(query.query(), 0.5), -side) << "angle 1e-" << exponent;
    }
  EXPECT_EQ(sideBefore(crossing(0, 1, 0.7).query(), 0.5), 0);
}

TEST(ImpactSide, IsCorrectForEdgesOfAnyLength) {
  for (const double side : {1.0, -1.0})
    for (double length = 1; length < 1e30; length *= 7)
      ASSERT_EQ(sideBefore(crossing(0.5, side, length).query(), 0.5), -side) << length;
}

/// Edges and distances between them are longer than the largest double.
TEST(ImpactSide, IsCorrectAtTheEndOfTheRange) {
  constexpr double kLarge = 0x1.fp1023;
  for (const double side : {1.0, -1.0}) {
    const ImpactCase small = crossing(0.5, side, 0.7);
    ImpactCase large = small;
    for (Eigen::Vector3d& p : large.positions) p = p / 0.8 * kLarge;
    EXPECT_EQ(sideBefore(large.query(), 0.5), -side);
    const auto found = positionsAt(large.query(), 0.25),
               expected = positionsAt(small.query(), 0.25);
    for (int i = 1; i < 4; ++i) {
      const Eigen::Vector3d difference = (found[i] / kLarge - found[0] / kLarge) * 0.8;
      EXPECT_LT((difference - (expected[i] - expected[0])).norm(), 1e-15) << i;
    }
  }
}

}  // namespace

}  // namespace palpate
