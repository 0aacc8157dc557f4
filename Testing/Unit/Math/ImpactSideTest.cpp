#include "ImpactCases.h"

#include "RationalOracle.h"

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

/// Features nearly in one plane at any time: the sign of rounded volumes is wrong. They rest, or
/// grow a lot.
TEST(ImpactSide, IsExactForFeaturesNearlyInOnePlane) {
  test::Random random(3);
  int signs[3] = {};
  for (int i = 0; i < 3000; ++i) {
    ImpactCase query{i % 2 == 0, {}};
    auto& p = query.positions;
    const Eigen::Vector3d u = random.inCube(), v = random.inCube(), origin = random.inCube(),
                          none = Eigen::Vector3d::Zero();
    const auto nearPlane = [&] {
      const double size = random.ldexp(random.unit(), -60, -30);
      const Eigen::Vector3d aside = size * random.inCube();
      const double alongU = random.unit(), alongV = random.unit();
      return Eigen::Vector3d(alongU * u + alongV * v + aside);
    };
    // The end of an edge, or a corner, from which the others differ by A and B.
    const std::size_t first = query.edges ? 0 : 1;
    const Eigen::Vector3d a = nearPlane(), b = nearPlane(), c = nearPlane();
    for (std::size_t end = 0; end < 2; ++end) {
      const double grown = end == 0 && i % 3 == 0 ? std::ldexp(1.0, -random.between(1, 60)) : 1.0;
      const Eigen::Vector3d at = i % 3 == 0 ? none : origin;
      Eigen::Vector3d* const ofEnd = &p[4 * end];
      if (query.edges) {
        ofEnd[0] = at;
        ofEnd[1] = at + grown * a;
        ofEnd[2] = at + grown * c;
        ofEnd[3] = at + grown * (c + b);
      } else {
        ofEnd[first] = at;
        ofEnd[2] = at + grown * a;
        ofEnd[3] = at + grown * b;
        ofEnd[0] = at + grown * c;
      }
    }
    const auto signAtEnd = [&](std::size_t end) {
      using oracle::operator-;
      const auto axes = ImpactQuery::axes(query.query().kind);
      std::array<oracle::Vector, 3> rows;
      for (std::size_t k = 0; k < 3; ++k)
        rows[k] = oracle::toRational(p[4 * end + static_cast<std::size_t>(axes[k][0])]) -
                  oracle::toRational(p[4 * end + static_cast<std::size_t>(axes[k][1])]);
      return sgn(oracle::dot(oracle::cross(rows[0], rows[1]), rows[2]));
    };
    const int expected = signAtEnd(1);
    if (signAtEnd(0) != expected) continue;  // rounding of the sums made the side change
    ASSERT_EQ(sideBefore(query.query(), 0.5), expected) << i;
    ++signs[1 + expected];
  }
  EXPECT_GT(std::min(signs[0], signs[2]), 500);
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

/// Where differences overflow, the side is exact, too. A vertex comes through the plane of a
/// turning triangle twice: first beside the triangle, at a quarter of the step, and then from the
/// other side through it.
TEST(ImpactSide, IsTheLastOneBeforeTheTime) {
  constexpr double kLarge = 0x1.fp1023;
  for (const double side : {1.0, -1.0})
    for (const double size : {1.0, kLarge}) {
      const auto at = [&](double x, double y, double z) {
        return Eigen::Vector3d(size * x, size * y, size * side * z);
      };
      const ImpactCase query{false,
                             {at(-0.6, -1, -0.2), at(-1, 0, 0), at(1, 0, 0), at(-1, 1, -1),
                              at(-0.6, 1, 0.4), at(-1, 0, 0), at(1, 0, 0), at(-1, 1, 1)}};
      EXPECT_EQ(sideBefore(query.query(), 0.4), -side);
      EXPECT_EQ(sideBefore(query.query(), 0.75), side);
    }
}

/// Features come from either side, with either order of corners.
TEST(ImpactSide, NormalsPointToWhereTheFirstFeatureCameFrom) {
  for (const double side : {1.0, -1.0}) {
    const Eigen::Vector3d up(0.0, 0.0, 0.01 * side), v(0.2, 0.3, 0.0), a(0, 0, 0), b(1, 0, 0),
        c(0, 1, 0);
    for (const ImpactCase& query :
         {crossing(0.5, side, 0.7), crossing(0.5, side, 0.7).permuted({1, 0, 2, 3}),
          ImpactCase{false, {v + up, a, b, c, v - up, a, b, c}},
          ImpactCase{false, {v + up, a, c, b, v - up, a, c, b}}}) {
      std::size_t exactDecisions = 0;
      const auto normal = normalOfPlane(query.query(), 0.5, exactDecisions);
      ASSERT_TRUE(normal);
      EXPECT_LT((*normal - side * Eigen::Vector3d::UnitZ()).norm(), 1e-15) << query.edges;
      EXPECT_EQ(exactDecisions, 0u);
    }
  }
}

}  // namespace
}  // namespace palpate
