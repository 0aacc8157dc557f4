#include "Math/ClosestPoint.h"

#include "Math/ExactClosestPoint.h"
#include "Math/Foot.h"

#include "Common/Sanitized.h"
#include "DistanceCheck.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <random>
#include <vector>

namespace palpate {
namespace {

using Eigen::Vector3d;
using oracle::checkEdgeEdge, oracle::checkVertexTriangle, oracle::DistanceCases,
    oracle::DistanceKind, oracle::Four, oracle::isDegenerate;

VertexTriangleDistance faceOf(const Four& x) {
  return vertexTriangleDistance(x[0], x[1], x[2], x[3]);
}
EdgeEdgeDistance edgesOf(const Four& x) { return edgeEdgeDistance(x[0], x[1], x[2], x[3]); }

/// The number of cases of each category. Long tests run more, and others.
int pairsOfEachKind() {
  const char* asked = std::getenv("PALPATE_DISTANCE_PAIRS");
  return asked ? std::atoi(asked) / oracle::kDistanceKinds : testing::casesOf(1500);
}

TEST(ClosestPoint, AgreesWithRationalArithmetic) {
  DistanceCases cases(std::getenv("PALPATE_DISTANCE_PAIRS") ? 8 : 7);
  oracle::Errors vertexTriangle, edgeEdge;
  for (int kind = 0; kind < oracle::kDistanceKinds; ++kind) {
    for (int i = 0; i < pairsOfEachKind() && !HasFailure(); ++i) {
      SCOPED_TRACE("kind " + std::to_string(kind) + ", number " + std::to_string(i));
      const Four x = cases.next(static_cast<DistanceKind>(kind));
      vertexTriangle.keepLarger(checkVertexTriangle(x));
      edgeEdge.keepLarger(checkEdgeEdge(x));
    }
  }
  const auto print = [](const char* name, const oracle::Errors& most) {
    std::printf("%s: distance %.2f, difference %.2f, closest points %.2f, normal %.2f ulp\n", name,
                most.distance, most.difference, most.witness, most.normal);
  };
  print("vertex-triangle", vertexTriangle);
  print("edge-edge", edgeEdge);
}

/// Features that touch are decided in integers.
TEST(ClosestPoint, OrdinaryFeaturesNeedNoExactArithmetic) {
  DistanceCases cases(7);
  int exact = 0;
  for (int i = 0; i < 2000; ++i) {
    const Four x = cases.next(DistanceKind::Random);
    exact += faceOf(x).exact + edgesOf(x).exact;
  }
  EXPECT_LT(exact, 4);
  const Vector3d a(0, 0, 0), b(4, 0, 0), c(0, 4, 0);
  EXPECT_TRUE(vertexTriangleDistance({1, 1, 0}, a, b, c).exact);
  EXPECT_TRUE(edgeEdgeDistance(b, c, {1, 3, -1}, {1, 3, 2}).exact);
}

/// Each border between two regions is where a weight or an offset is zero.
TEST(ClosestPoint, EveryRegionBorderOfATriangleIsCrossed) {
  const std::vector<std::array<Vector3d, 3>> triangles{
      {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0)},
      {Vector3d(0.1, 0.2, 0.3), Vector3d(1.3, -0.4, 0.7), Vector3d(0.6, 1.1, -0.2)},
      {Vector3d(1e6, 1e6, 1e6), Vector3d(1e6 + 1, 1e6, 1e6 + 0.25), Vector3d(1e6, 1e6 + 3, 1e6)},
      {Vector3d(0, 0, 0), Vector3d(1, 1e-13, 0), Vector3d(2, 0, 1e-13)}};
  for (const auto& [a, b, c] : triangles) {
    const Vector3d ab = b - a, normal = ab.cross(c - a).normalized(),
                   inward = normal.cross(ab).normalized();
    for (const double along :
         {-0.5, -1e-15, 0.0, 1e-15, 0.25, 0.5, 1.0 - 1e-15, 1.0, 1.0 + 1e-15, 1.5})
      for (const double side : {-0.5, -1e-15, 0.0, 1e-15, 0.1})
        for (const double height : {-1.0, -1e-9, 0.0, 1e-15, 0.05}) {
          if (HasFailure()) return;
          const Vector3d p = a + along * ab + side * inward + height * normal;
          checkVertexTriangle({p, a, b, c});
          checkVertexTriangle({p, b, c, a});
          checkVertexTriangle({p, c, b, a});
        }
  }
}

TEST(ClosestPoint, EveryRegionBorderOfTwoEdgesIsCrossed) {
  for (const double tilt : {0.0, 1e-300, 1e-16, 1e-8, 0.3, 2.0})
    for (const double s : {-0.25, -1e-15, 0.0, 1e-15, 0.5, 1.0, 1.0 + 1e-15, 1.5})
      for (const double t : {-0.25, 0.0, 1e-15, 0.5, 1.0 - 1e-15, 1.0, 1.5})
        for (const double height : {0.0, 1e-12, 0.5}) {
          if (HasFailure()) return;
          // The lines meet, height apart, at s of the first and t of the second.
          const Vector3d p0(0.1, 0.2, 0.3), p(1.0, 0.5, 0.25);
          const Vector3d q = p + tilt * Vector3d(-0.5, 1, 0),
                         q0 = p0 + s * p - t * q + height * Vector3d(0, 0, 1);
          checkEdgeEdge({p0, p0 + p, q0, q0 + q});
        }
}

/// What fuzzing found. DistanceCases has random positions of most of these kinds.
TEST(ClosestPoint, FoundPositionsAgreeWithRationalArithmetic) {
  const Vector3d none = Vector3d::Zero();
  constexpr double kLeast = std::numeric_limits<double>::denorm_min();
  const Vector3d p(1, kLeast, 0), q(4, 3 * kLeast, 0);
  const std::pair<const char*, Four> found[] = {
      {"scaled positions have sums that overflow",
       {Vector3d(2, 0, 0x1.fp-1021), Vector3d(2, 0, 0x1p-1050), Vector3d(2, 0, 0x1.74p-1021),
        Vector3d(2, 0, 0x1.74p-1021)}},
      {"weights of 1/2 and 2^-53 more have a sum that rounds to 1",
       {Vector3d(0x1.0000000000003p-66, 0x1.78p+34, 0x1.78p+34),
        Vector3d(0x1.78p+34, 0x1.78p+35, 0x1.7800000000001p+34),
        Vector3d(0, 0x1.68p+19, 0x1.aef94p-72), none}},
      {"the weight along an edge that is 2^-52 of the others has an error",
       {Vector3d(1, 0, 0x0.00000ffd1de4p-1022), Vector3d(1, -0x1.bp+4, -0x1.bp+4),
        Vector3d(1, -0x1.affffffffffffp+4, -0x1.b000000000001p+4),
        Vector3d(0x0.0005d61bba9e5p-1022, 0, 0x1.000ffffffff23p-895)}},
      {"ends are equally far within rounding, and the vectors to them differ by more",
       {Vector3d(13697, 0x1.ep45, 1), Vector3d(81, 0x1.ep45, 3), none, none}},
      {"the same",
       {Vector3d(1, -3848290697215, 1), Vector3d(-0x1p-414, -3848290697215, 1), none, none}},
      {"the same",
       {Vector3d(9000, 0x1p45, 0), Vector3d(1, 0x1p45, 0), Vector3d(-3, 0, 0), Vector3d(-2, 0, 0)}},
      {"the square of the normal is denormal",
       {Vector3d(-2.8468967807917267e-267, -1.2114454386347773e-268, 6.0572271931738892e-269),
        Vector3d(0, 0, 1.3435752215134178e-138),
        Vector3d(0, -8.6172813846470428e-19, 1.817168157952166e-268),
        Vector3d(1.2126554232481092e-34, 5.0274985703343258e-267, 1.3435752215134175e-138)}},
      {"another end's distance is computed as 0", {none, p, none, q}},
      {"the same", {none, p, q, none}},
      {"the same", {p, none, q, none}}};
  for (const auto& [fault, x] : found) {
    SCOPED_TRACE(fault);
    checkVertexTriangle(x);
    checkEdgeEdge(x);
  }
}

/// The interval that two parallel edges share is so short on one of them that its weight is 0 or 1.
TEST(ClosestPoint, MiddlesOfShortSharedIntervalsAreEnds) {
  const Vector3d zero = Vector3d::Zero(), x = Vector3d::UnitX(), beyond(0x1p-60, 1, 0),
                 before(0x1p-60 - 0x1p-50, 1, 0);
  const EdgeEdgeDistance start = edgeEdgeDistance(zero, x, beyond, before),
                         end = edgeEdgeDistance(x, zero, beyond, before),
                         swapped = edgeEdgeDistance(before, beyond, zero, x);
  EXPECT_TRUE(start.parallel && end.parallel && swapped.parallel);
  EXPECT_EQ(start.featureA, EdgeFeature::Start);
  EXPECT_EQ(start.featureB, EdgeFeature::Interior);
  EXPECT_EQ(end.featureA, EdgeFeature::End);
  EXPECT_EQ(end.featureB, EdgeFeature::Interior);
  EXPECT_EQ(swapped.featureA, EdgeFeature::Interior);
  EXPECT_EQ(swapped.featureB, EdgeFeature::Start);
}

/// Found by fuzzing: the foot of q's end is inside p, but so near to p's end that its weight rounds
/// to 1, and the distances to both are equal within rounding. The difference is to the foot: it is
/// right to 2^-50 of its length, also across the direction to the end.
TEST(ClosestPoint, FeetNextToAnEndHaveTheirOwnDifference) {
  for (int exponent = 20; exponent < 45; ++exponent) {
    const double height = std::ldexp(1.0, -exponent);
    const Vector3d p0 = Vector3d::Zero(), p1(0, 1.75, 1.25 * height), q0(0, 1.75, 0),
                   q1(0, 1.75, height);
    const EdgeEdgeDistance forward = edgeEdgeDistance(p0, p1, q0, q1),
                           swapped = edgeEdgeDistance(q0, q1, p0, p1);
    // (0, -1.25 h, 1.75) is perpendicular to p, and h / 4 is the height of p1 over q1.
    const double along = 1.75 * (height / 4) / (1.75 * 1.75 + 1.5625 * height * height);
    const Vector3d expected = along * Vector3d(0, -1.25 * height, 1.75);
    EXPECT_LE((forward.difference - expected).norm(), 0x1p-50 * expected.norm()) << exponent;
    EXPECT_LE((swapped.difference + expected).norm(), 0x1p-50 * expected.norm()) << exponent;
    EXPECT_LT(std::abs(forward.difference[1] / expected[1] - 1.0), 0x1p-20) << exponent;
    checkEdgeEdge({p0, p1, q0, q1});
  }
}

// ---- Invariances ----

using Bits = std::vector<std::uint64_t>;

void append(Bits& bits, double value) { bits.push_back(std::bit_cast<std::uint64_t>(value + 0.0)); }
void append(Bits& bits, const Vector3d& value) {
  for (const double x : value) append(bits, x);
}

/// With weights in the order of corners a, b, c.
Bits bitsOf(const VertexTriangleDistance& d, const std::array<int, 3>& order = {0, 1, 2}) {
  Bits bits;
  for (const int i : order) append(bits, d.weights[i]);
  append(bits, d.difference);
  if (d.distance > 0.0) append(bits, d.normal);
  append(bits, d.distance);
  return bits;
}

Bits bitsOf(const EdgeEdgeDistance& d) {
  Bits bits;
  append(bits, d.weightA);
  append(bits, d.weightB);
  append(bits, d.difference);
  if (d.distance > 0.0) append(bits, d.normal);
  append(bits, d.distance);
  return bits;
}

/// Expects the same bits for exchanged edges and exchanged ends.
void expectSwapped(const Four& x) {
  const auto& [p0, p1, q0, q1] = x;
  const EdgeEdgeDistance answer = edgesOf(x);
  EdgeEdgeDistance edges = edgesOf({q0, q1, p0, p1}), first = edgesOf({p1, p0, q0, q1}),
                   second = edgesOf({p0, p1, q1, q0});
  std::swap(edges.weightA, edges.weightB);
  edges.difference = -edges.difference;
  edges.normal = -edges.normal;
  first.weightA = 1.0 - first.weightA;
  second.weightB = 1.0 - second.weightB;
  for (const EdgeEdgeDistance& other : {edges, first, second})
    ASSERT_EQ(bitsOf(other), bitsOf(answer));
  if (answer.parallel) {
    ASSERT_EQ(edges.normal, answer.normal);
  }
}

TEST(ClosestPoint, ExchangedCornersEdgesAndEndsKeepTheBits) {
  DistanceCases cases(7);
  for (int kind = 0; kind < oracle::kDistanceKinds; ++kind)
    for (int i = 0; i < 300 && !HasFailure(); ++i) {
      SCOPED_TRACE("kind " + std::to_string(kind) + ", number " + std::to_string(i));
      const Four x = cases.next(static_cast<DistanceKind>(kind));
      if (!edgesOf(x).parallel) expectSwapped(x);
      if (isDegenerate(x)) continue;
      std::array<int, 3> order{0, 1, 2}, back{};
      do {
        for (int j = 0; j < 3; ++j) back[order[j]] = j;
        ASSERT_EQ(bitsOf(faceOf({x[0], x[1 + order[0]], x[1 + order[1]], x[1 + order[2]]}), back),
                  bitsOf(faceOf(x)));
      } while (std::next_permutation(order.begin(), order.end()));
    }
}

/// Parallel edges in every relation: along an axis with coordinates of two decimals, or in any
/// direction; side by side, behind each other, collinear.
TEST(ClosestPoint, ExchangedParallelEdgesAndEndsKeepTheBits) {
  DistanceCases random(7);
  int touching = 0;
  for (int i = 0; i < 20000; ++i) {
    Four x;
    if (i % 2 == 0) {
      const int axis = random.below(3);
      for (Vector3d& p : x)
        p = Vector3d{double(random.below(1000)), double(random.below(1000)), 0} / 100;
      x[1] = x[0], x[3] = x[2];
      x[1][axis] += 0.01 * (1 + random.below(1000));
      x[3][axis] -= 0.01 * (1 + random.below(1000));
    } else {
      const auto onGrid = [&](int size) {
        return Vector3d{double(random.below(size)), double(random.below(size)),
                        double(random.below(size))};
      };
      const Vector3d along = onGrid(64), at = onGrid(9);
      x = {at, Vector3d(at + along), Vector3d(at + 0.5 * random.below(5) * along),
           Vector3d(at - 0.25 * random.below(9) * along)};
      if (random.below(2)) x[2] += Vector3d(3, -1, 2), x[3] += Vector3d(3, -1, 2);
    }
    const auto& [p0, p1, q0, q1] = x;
    if (p0 == p1 || q0 == q1) continue;  // all weights name one point
    if ((p0 == q0 && p1 == q1) || (p0 == q1 && p1 == q0)) continue;
    SCOPED_TRACE(i);
    expectSwapped(x);
    if (HasFatalFailure()) return;
    touching += edgesOf(x).distance == 0.0;
  }
  EXPECT_GT(touching, 1000);
}

template <class Answer>
Bits mirroredBits(Answer answer) {
  answer.difference[0] = -answer.difference[0];
  answer.normal[0] = -answer.normal[0];
  return bitsOf(answer);
}

template <class Answer>
Bits scaledBits(Answer answer, int exponent) {
  for (double& x : answer.difference) x = std::ldexp(x, exponent);
  answer.distance = std::ldexp(answer.distance, exponent);
  return bitsOf(answer);
}

/// Of positions that a function maps to others.
template <class F>
Four mapped(Four x, F&& f) {
  for (Vector3d& p : x) p = f(p);
  return x;
}

/// Scales from where distances of 1e-17 of the positions still have all their bits to where squared
/// lengths have long overflowed.
TEST(ClosestPoint, MirroredScaledAndMovedPositionsKeepTheBits) {
  DistanceCases cases(7);
  for (int k = 0; k < oracle::kDistanceKinds; ++k) {
    const auto kind = static_cast<DistanceKind>(k);
    // Corners on a grid may be mirror images of each other. Corners of a triangle without area may
    // have one place.
    const bool isOnGrid = kind == DistanceKind::SmallGrid || kind == DistanceKind::FarEdges ||
                          kind == DistanceKind::SmallFarAway,
               isNearOne = k <= static_cast<int>(DistanceKind::NoArea) ||
                           kind == DistanceKind::MiddleOfTheLongestEdge;
    for (int i = 0; i < 200; ++i) {
      SCOPED_TRACE("kind " + std::to_string(k) + ", number " + std::to_string(i));
      const Four x = cases.next(kind);
      const bool hasArea = !isDegenerate(x);
      const EdgeEdgeDistance edges = edgesOf(x);
      const VertexTriangleDistance face = faceOf(x);
      const Four mirrored =
          mapped(x, [](const Vector3d& p) { return Vector3d(-p[0], p[1], p[2]); });
      ASSERT_EQ(mirroredBits(edgesOf(mirrored)), bitsOf(edges));
      if (!isOnGrid && hasArea) {
        ASSERT_EQ(mirroredBits(faceOf(mirrored)), bitsOf(face));
      }
      if (kind == DistanceKind::SmallGrid || kind == DistanceKind::FarEdges) {
        const Four moved =
            mapped(x, [](const Vector3d& p) -> Vector3d { return p + Vector3d(1e6, -3e6, 5e5); });
        ASSERT_EQ(bitsOf(edgesOf(moved)), bitsOf(edges));
        ASSERT_EQ(bitsOf(faceOf(moved)), bitsOf(face));
      }
      if (!isNearOne) continue;
      for (const int exponent : {-900, -521, -260, -99, -7, 79, 101, 255, 512, 900, 1001}) {
        const Four y = mapped(x, [&](const Vector3d& p) { return test::scaled(p, exponent); });
        ASSERT_EQ(bitsOf(edgesOf(y)), scaledBits(edges, exponent)) << "2^" << exponent;
        if (hasArea) {
          ASSERT_EQ(bitsOf(faceOf(y)), scaledBits(face, exponent)) << "2^" << exponent;
        }
      }
    }
  }
}

TEST(ClosestPoint, TrianglesThatShareAnEdgeAgreeOnIt) {
  DistanceCases cases(7);
  int shared = 0;
  for (int i = 0; i < 3000; ++i) {
    const auto [p, a, b, c] = cases.next(static_cast<DistanceKind>(i % 7));
    const Vector3d d = cases.next(DistanceKind::Random)[0];
    const VertexTriangleDistance left = vertexTriangleDistance(p, a, b, c);
    const VertexTriangleDistance right = vertexTriangleDistance(p, b, a, d);
    if (left.feature != TriangleFeature::EdgeAB || right.feature != TriangleFeature::EdgeAB)
      continue;
    ++shared;
    Bits leftBits, rightBits;
    append(leftBits, left.difference);
    append(leftBits, left.weights[0]);
    append(rightBits, right.difference);
    append(rightBits, right.weights[1]);
    ASSERT_EQ(leftBits, rightBits);
  }
  EXPECT_GT(shared, 100);
}

// ---- Sides ----

TEST(ClosestPoint, SidesAreExact) {
  DistanceCases cases(7);
  int inwards = 0, nearer = 0;
  constexpr int kCases = 8000;
  for (int i = 0; i < kCases; ++i) {
    const auto [p, a, b, c] = cases.next(static_cast<DistanceKind>(i % oracle::kDistanceKinds));
    ASSERT_EQ(liesInwards(p, a, b, c), exact::side(p, a, b, c) > 0) << i;
    ASSERT_EQ(comesNearer(p, a, b), exact::along(p, a, b) > 0) << i;
    inwards += liesInwards(p, a, b, c);
    nearer += comesNearer(p, a, b);
  }
  EXPECT_GT(std::min(inwards, nearer), kCases / 8);
  EXPECT_LT(std::max(inwards, nearer), kCases * 7 / 8);
}

// ---- Single values ----

TEST(ClosestPoint, NormalsOfTouchingFeaturesFollowTheirRule) {
  const Vector3d a(0, 0, 0), b(2, 0, 0), c(0, 2, 0);
  for (const Vector3d& p : {a, Vector3d(1, 0, 0), Vector3d(0.5, 0.5, 0)}) {
    EXPECT_EQ(vertexTriangleDistance(p, a, b, c).distance, 0.0);
    EXPECT_EQ(vertexTriangleDistance(p, a, b, c).normal, Vector3d(0, 0, 1));
    EXPECT_EQ(vertexTriangleDistance(p, a, c, b).normal, Vector3d(0, 0, -1));
  }
  const Vector3d third = vertexTriangleDistance({1, 0, 0}, {0, 0, 0}, {3, 0, 0}, {0, 0, 3}).normal;
  EXPECT_EQ(third, Vector3d(0, -1, 0));
  const EdgeEdgeDistance crossed = edgeEdgeDistance({-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0});
  EXPECT_EQ(crossed.distance, 0.0);
  EXPECT_EQ(crossed.normal, Vector3d(0, 0, 1));
}

TEST(ClosestPoint, DegenerateFeaturesCountAsSegmentsOrPoints) {
  const Vector3d point(1, 2, 3);
  const VertexTriangleDistance onPoint =
      vertexTriangleDistance(point + Vector3d(0, 3, 4), point, point, point);
  EXPECT_EQ(onPoint.distance, 5.0);
  EXPECT_EQ(onPoint.normal, Vector3d(0, 0.6, 0.8));
  EXPECT_EQ(onPoint.feature, TriangleFeature::CornerA);
  EXPECT_EQ(vertexTriangleDistance(point, point, point, point).normal, Vector3d(1, 0, 0));

  const VertexTriangleDistance onSegment =
      vertexTriangleDistance({1, 1, 0}, {0, 0, 0}, {1, 0, 0}, {3, 0, 0});
  EXPECT_EQ(onSegment.feature, TriangleFeature::EdgeCA);
  EXPECT_EQ(onSegment.distance, 1.0);
  EXPECT_EQ(vertexTriangleDistance({1, 0, 0}, {0, 0, 0}, {1, 0, 0}, {3, 0, 0}).normal,
            Vector3d(0, 1, 0));

  const EdgeEdgeDistance points = edgeEdgeDistance(point, point, point, point);
  EXPECT_TRUE(points.parallel);
  EXPECT_EQ(points.distance, 0.0);
  EXPECT_EQ(points.normal, Vector3d(1, 0, 0));
}

TEST(ClosestPoint, ParallelEdgesAreClosestInTheMiddleOfTheirOverlap) {
  const EdgeEdgeDistance beside = edgeEdgeDistance({0, 0, 0}, {4, 0, 0}, {5, 1, 0}, {1, 1, 0});
  EXPECT_TRUE(beside.parallel);
  EXPECT_EQ(beside.weightA, 0.625);
  EXPECT_EQ(beside.weightB, 0.625);
  EXPECT_EQ(beside.distance, 1.0);
  EXPECT_EQ(beside.normal, Vector3d(0, -1, 0));
  const EdgeEdgeDistance beyond = edgeEdgeDistance({0, 0, 0}, {1, 0, 0}, {4, 4, 0}, {7, 4, 0});
  EXPECT_EQ(beyond.weightA, 1.0);
  EXPECT_EQ(beyond.weightB, 0.0);
  EXPECT_EQ(beyond.distance, 5.0);
}

/// Differences beyond the range of double, the smallest ones, and angles too narrow for floating
/// point.
TEST(UnitCross, IsExactInTheWholeRange) {
  const Vector3d zero = Vector3d::Zero(), large = Vector3d(1, 0.5, -0.25) * 0x1.8p1023,
                 small = Vector3d(3, -2, 1) * 0x1p-1074, one(1, 2, 3);
  const std::array<std::array<Vector3d, 2>, 6> edges{
      {{-large, large},
       {Vector3d(-large[1], -large[0], large[2]), Vector3d(large[1], large[0], -large[2])},
       {zero, small},
       {zero, one},
       {zero, one + Vector3d(0, 0x1p-30, 0)},
       {zero, one + Vector3d(0x1p-52, 0, 0)}}};
  for (std::size_t i = 0; i < edges.size(); ++i)
    for (std::size_t j = 0; j < edges.size(); ++j) {
      SCOPED_TRACE(std::to_string(i) + ' ' + std::to_string(j));
      const auto& [a, b] = edges[i];
      const auto& [c, d] = edges[j];
      std::size_t decisions = 0;
      const Vector3d normal = unitCross(a, b, c, d, &decisions),
                     exact = exact::unitCross(a, b, c, d);
      EXPECT_LE((normal - exact).norm(), 1e-15);
      EXPECT_NEAR(normal.norm(), i == j ? 0.0 : 1.0, 1e-15);
      EXPECT_LE(decisions, 1u);
      if (i == j && i > 1) {  // without overflow
        EXPECT_EQ(unitCross(a, b, d, c, &decisions), Vector3d::Zero());
        EXPECT_EQ(decisions, 0u) << "equal and opposite edges need no integers";
      }
    }
}

/// Sign of a distance less a radius, from another distance less another radius.
TEST(CompareDistances, TakesRadiiIntoAccount) {
  const Vector3d p(0, 0, 5), x(1, 0, 0), y(0, 1, 0);
  for (const double height : {0.0, 1.0, 2.0, 9.0})
    for (const double radius : {0.0, 0.5, 1.0, 3.0, 7.0})
      for (const double otherHeight : {0.0, 1.0, 3.0})
        for (const double otherRadius : {0.0, 0.5, 1.0, 2.0}) {
          const Vector3d a(0, 0, height), b(0, 0, otherHeight);
          const exact::ClosestFeature one{a, x, y, TriangleFeature::CornerA, {radius, 0, 0}},
              two{b, x, y, TriangleFeature::CornerA, {otherRadius, 0, 0}};
          const double distance = std::abs(5 - height) - radius,
                       other = std::abs(5 - otherHeight) - otherRadius;
          EXPECT_EQ(exact::compareDistances(p, one, two), distance < other ? -1 : distance > other)
              << height << ' ' << radius << ' ' << otherHeight << ' ' << otherRadius;
        }
}

TEST(ClosestPoint, LargestDoublesGiveFiniteResults) {
  const double most = std::numeric_limits<double>::max();
  const VertexTriangleDistance far = vertexTriangleDistance(
      {most, most, most}, {-most, -most, -most}, {-most, most, -most}, {-most, -most, most});
  EXPECT_EQ(far.distance, std::numeric_limits<double>::infinity());
  EXPECT_NEAR(far.normal.norm(), 1.0, 1e-15);
  const VertexTriangleDistance flat =
      vertexTriangleDistance({0, 0, 1}, {-most, -most, 0}, {most, -most, 0}, {0, most, 0});
  EXPECT_EQ(flat.distance, 1.0);
  EXPECT_EQ(flat.normal, Vector3d(0, 0, 1));
}

TEST(ClosestPoint, NaNGivesNaN) {
  const double nan = std::numeric_limits<double>::quiet_NaN(),
               infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, infinity, -infinity}) {
    EXPECT_TRUE(
        std::isnan(vertexTriangleDistance({0, 0, 0}, {bad, 0, 0}, {1, 0, 0}, {0, 1, 0}).distance));
    EXPECT_TRUE(
        std::isnan(edgeEdgeDistance({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, bad, 1}).distance));
  }
}

/// Edges of grids that lie on each other. Their coordinates are computed, so that they are parallel
/// exactly or up to a rounding. Some are far from the origin, and some have rounding errors instead
/// of zeros.
TEST(ClosestPoint, EdgesOfGridsAreClassifiedExactly) {
  std::mt19937 random(11);
  const auto below = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
  int parallel = 0, interior = 0, outside = 0, inIntegers = 0;
  for (int repeat = 0; repeat < 40000; ++repeat) {
    const double edge = 2.0 / 30;
    const Vector3d far = below(4) ? Vector3d(0, 0, 0) : Vector3d(1e4, -3e5, 7e3);
    const int sideways = below(3), x = below(30), y = below(30);
    const auto onGrid = [&](int i, int j, const Vector3d& moved) -> Vector3d {
      return far + (Vector3d(i * edge - 1, j * edge - 1, 0) + moved);
    };
    const int alongX = sideways != 1, alongY = sideways != 0;
    const Vector3d moved{below(2) ? 0.3 * edge : 0.0, below(2) ? 0.1 * edge : 0.0,
                         below(2) ? 0.03 * edge : std::ldexp(1.0, -1074)};
    Vector3d p0 = onGrid(x, y, Vector3d::Zero()),
             p1 = onGrid(x + alongX, y + alongY, Vector3d::Zero());
    const int i = x + below(3) - 1, j = y + below(3) - 1;
    Vector3d q0 = onGrid(i, j, moved), q1 = onGrid(i + alongX, j + alongY, moved);
    if (below(3) == 0) q1[below(3)] += (below(2) ? 1 : -1) * std::ldexp(1.0, -54);
    if (below(8) == 0)
      for (Vector3d* position : {&p0, &p1, &q0, &q1}) *position *= below(2) ? 0x1p-980 : 0x1p300;
    const CrossingPlace truth = exact::crossing(p0, p1, q0, q1);
    const EdgeEdgeDistance answer = finiteEdgeEdgeDistance(p0, p1, q0, q1);
    ASSERT_EQ(answer.parallel, truth == CrossingPlace::Parallel) << repeat;
    ASSERT_EQ(crossingEdgesDistance(p0, p1, q0, q1).has_value(), truth == CrossingPlace::Interior)
        << repeat;
    parallel += truth == CrossingPlace::Parallel;
    interior += truth == CrossingPlace::Interior;
    outside += truth == CrossingPlace::Outside;
    inIntegers += truth == CrossingPlace::Parallel && answer.exact;
  }
  EXPECT_GT(parallel, 10000);
  EXPECT_GT(outside, 5000);
  EXPECT_GT(interior, 1);
  EXPECT_LT(inIntegers, parallel / 3);
}

}  // namespace
}  // namespace palpate
