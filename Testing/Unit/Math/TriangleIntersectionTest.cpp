#include <palpate/FeaturePairs.h>

#include "Common/Sanitized.h"
#include "Math/TriangleIntersection.h"
#include "Unit/Math/IntersectionOracle.h"
#include "Unit/Math/TrianglePairs.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <bit>

namespace palpate::test {
namespace {

constexpr int kKinds = static_cast<int>(Kind::Count);

/// Moves the bits to their places if corner i had been named corner order[i]. This is the expected
/// result of intersectTriangles for a and b with their corners in that order.
struct Order {
  std::array<int, 3> corner;
  Corners operator()(const Corners& t) const { return {t[corner[0]], t[corner[1]], t[corner[2]]}; }
  /// The edge i of the reordered triangle, as an edge of the original.
  int edge(int i) const {
    const int p = corner[i], q = corner[(i + 1) % 3];
    return (p + 1) % 3 == q ? p : q;
  }
};

TriangleIntersection reordered(const TriangleIntersection& r, const Order& a, const Order& b) {
  TriangleIntersection s;
  for (int i = 0; i < 3; ++i) {
    s.cornersOfAOnB |= (r.cornersOfAOnB >> a.corner[i] & 1) << i;
    s.cornersOfBOnA |= (r.cornersOfBOnA >> b.corner[i] & 1) << i;
    s.edgesOfAThroughB |= (r.edgesOfAThroughB >> a.edge(i) & 1) << i;
    s.edgesOfBThroughA |= (r.edgesOfBThroughA >> b.edge(i) & 1) << i;
    for (int j = 0; j < 3; ++j)
      s.touchingEdges |= (r.touchingEdges >> (3 * a.edge(i) + b.edge(j)) & 1) << (3 * i + j);
  }
  return s;
}

TriangleIntersection swapped(const TriangleIntersection& r) {
  TriangleIntersection s{r.cornersOfBOnA, r.cornersOfAOnB, 0, r.edgesOfBThroughA,
                         r.edgesOfAThroughB};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      s.touchingEdges |= (r.touchingEdges >> (3 * j + i) & 1) << (3 * i + j);
  return s;
}

void expectSame(const TriangleIntersection& r, const TriangleIntersection& s, int kind) {
  ASSERT_EQ(r.cornersOfAOnB, s.cornersOfAOnB) << kind;
  ASSERT_EQ(r.cornersOfBOnA, s.cornersOfBOnA) << kind;
  ASSERT_EQ(r.touchingEdges, s.touchingEdges) << kind;
  ASSERT_EQ(r.edgesOfAThroughB, s.edgesOfAThroughB) << kind;
  ASSERT_EQ(r.edgesOfBThroughA, s.edgesOfBThroughA) << kind;
}

const std::array<Order, 6> kOrders{
    {{{0, 1, 2}}, {{1, 2, 0}}, {{2, 0, 1}}, {{0, 2, 1}}, {{2, 1, 0}}, {{1, 0, 2}}}};

TEST(TriangleIntersection, ReorderingCornersOrTrianglesPermutesTheResult) {
  Random random(11);
  SignCounts counts;
  for (int repeat = 0; repeat < 300 * kKinds; ++repeat) {
    const auto [a, b] = makePair(static_cast<Kind>(repeat % kKinds), random);
    const TriangleIntersection result = intersectTriangles(a, b, counts);
    expectSame(intersectTriangles(b, a, counts), swapped(result), repeat % kKinds);
    for (const Order& orderA : kOrders)
      for (const Order& orderB : kOrders)
        expectSame(intersectTriangles(orderA(a), orderB(b), counts),
                   reordered(result, orderA, orderB), repeat % kKinds);
    if (HasFatalFailure()) return;
  }
}

/// The reported features must be consistent for any triangles.
TEST(TriangleIntersection, IntersectionWithoutTouchHasTwoCrossings) {
  Random random(13);
  SignCounts counts;
  std::array<int, 3> seen{};
  for (int repeat = 0; repeat < 3000 * kKinds; ++repeat) {
    const auto [a, b] = makePair(static_cast<Kind>(repeat % kKinds), random);
    const TriangleIntersection result = intersectTriangles(a, b, counts);
    if (result.touch() || !result.intersect()) continue;
    const int ofA = std::popcount(result.edgesOfAThroughB),
              ofB = std::popcount(result.edgesOfBThroughA);
    ASSERT_EQ(ofA + ofB, 2) << repeat % kKinds;
    ++seen[ofA];
  }
  for (const int count : seen) EXPECT_GT(count, 100);
}

/// Two independent decisions of the same question. Distances under the smallest denormal round to
/// zero.
TEST(TriangleIntersection, FeaturesTouchWhereTheirDistanceIsZero) {
  Random random(14);
  SignCounts counts;
  std::array<int, 2> touching{};
  for (int repeat = 0; repeat < 300 * kKinds; ++repeat) {
    const auto kind = static_cast<Kind>(repeat % kKinds);
    const bool mayRoundToZero =
        kind == Kind::MixedExponents || kind == Kind::Tiny || kind == Kind::Denormal;
    const auto [a, b] = makePair(kind, random);
    const TriangleIntersection result = intersectTriangles(a, b, counts);
    for (int i = 0; i < 3; ++i) {
      const bool corner = result.cornersOfAOnB >> i & 1;
      const double distance = vertexTriangleDistance(a[i], b[0], b[1], b[2]).distance;
      ASSERT_TRUE(corner ? distance == 0 : distance > 0 || mayRoundToZero) << repeat % kKinds;
      touching[0] += corner;
      for (int j = 0; j < 3; ++j) {
        const bool edges = result.touchingEdges >> (3 * i + j) & 1;
        const double between =
            edgeEdgeDistance(a[i], a[(i + 1) % 3], b[j], b[(j + 1) % 3]).distance;
        ASSERT_TRUE(edges ? between == 0 : between > 0 || mayRoundToZero) << repeat % kKinds;
        touching[1] += edges;
      }
    }
  }
  for (const int count : touching) EXPECT_GT(count, 1000);
}

TEST(TriangleIntersection, AgreesWithRationalArithmetic) {
  Random random(16);
  std::array<int, 2> found{};
  for (int repeat = 0; repeat < palpate::testing::casesOf(500) * kKinds; ++repeat) {
    const auto [a, b] = makePair(static_cast<Kind>(repeat % kKinds), random);
    const bool truth = intersection::trianglesIntersect({a[0], a[1], a[2], b[0], b[1], b[2]});
    ASSERT_EQ(trianglesIntersect(a[0], a[1], a[2], b[0], b[1], b[2]), truth) << repeat % kKinds;
    ++found[truth];
  }
  for (const int count : found) EXPECT_GT(count, palpate::testing::casesOf(1000));
}

TEST(TriangleIntersection, EachSimpleConfigurationHasItsFeatures) {
  SignCounts counts;
  const Corners ground{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}};
  const auto above = [&](Eigen::Vector3d p, Eigen::Vector3d q, Eigen::Vector3d r) {
    return intersectTriangles({p, q, r}, ground, counts);
  };
  const auto pierced = above({1, 1, -1}, {1, 1.5, 2}, {1.5, 1, 2});
  EXPECT_EQ(pierced.edgesOfAThroughB, 0b101);
  EXPECT_FALSE(pierced.touch() || pierced.edgesOfBThroughA);
  const auto interlocked = above({1, 1, -1}, {1, 1, 1}, {1, -5, 0.5});
  EXPECT_EQ(interlocked.edgesOfAThroughB, 0b001);
  EXPECT_EQ(interlocked.edgesOfBThroughA, 0b001);
  EXPECT_FALSE(interlocked.touch());
}

}  // namespace
}  // namespace palpate::test
