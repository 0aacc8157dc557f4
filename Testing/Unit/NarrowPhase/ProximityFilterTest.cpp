#include "NarrowPhase/ProximityFilter.h"

#include "Common/EverySimdPath.h"
#include "Common/Sanitized.h"
#include "NarrowPhase/FeatureTests.h"
#include "Math/ClosestPoint.h"
#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace palpate::test {
namespace {

using Eigen::Vector3d;
using Pair = std::array<Vector3d, 6>;  // corners of a, of b
using Possible = std::array<std::uint32_t, TrianglePairBatch::kSize>;

constexpr std::uint32_t kAllTests = (1u << kTests) - 1;

/// The distance of the features of a test. With `distinct`, edges that do not cross inside have
/// none.
std::optional<double> distanceOf(const Pair& x, int test, bool distinct) {
  const auto corner = [&](int triangle, int i) { return x[3 * triangle + i % 3]; };
  const auto distanceTo = [&](int triangle, const Vector3d& p) {
    return vertexTriangleDistance(p, corner(triangle, 0), corner(triangle, 1), corner(triangle, 2))
        .distance;
  };
  if (isCorner(kFeatureOfA[test])) return distanceTo(1, corner(0, kFeatureOfA[test]));
  if (isCorner(kFeatureOfB[test])) return distanceTo(0, corner(1, kFeatureOfB[test]));
  const int i = edgeNumber(kFeatureOfA[test]), j = edgeNumber(kFeatureOfB[test]);
  if (!distinct)
    return edgeEdgeDistance(corner(0, i), corner(0, i + 1), corner(1, j), corner(1, j + 1))
        .distance;
  const auto answer =
      crossingEdgesDistance(corner(0, i), corner(0, i + 1), corner(1, j), corner(1, j + 1));
  return answer ? std::optional(answer->distance) : std::nullopt;
}

/// The tests that the filter keeps of each pair, the same on every SIMD path.
Possible filter(const std::vector<Pair>& pairs, double thickness, bool distinct,
                double checkedEdgeDistance = 0.0) {
  TrianglePairBatch batch{};
  for (std::size_t n = 0; n < pairs.size(); ++n)
    for (int row = 0; row < 18; ++row) batch.coordinates[row][n] = pairs[n][row / 3][row % 3];
  const auto find = [&] {
    std::uint32_t possible[TrianglePairBatch::kSize];
    findPossibleProximity(batch, thickness, distinct, checkedEdgeDistance, possible);
    return std::to_array(possible);
  };
  const Possible best = find();
  for (const std::string& path : testing::EverySimdPath()) EXPECT_EQ(find(), best) << path;
  return best;
}

double signedUnit(Random& random) { return 2 * random.unit() - 1; }
double smallPower(Random& random) { return std::pow(10.0, -random.below(12)); }
int someEdges(Random& random) {
  const int i = random.below(3), j = random.below(3);
  return edgeTest(i, j);
}

constexpr int kKinds = 12;

Pair pairOf(int kind, Random& random) {
  Pair x;
  for (Vector3d& v : x) v = random.inCube();
  switch (kind) {
    case 1:  // far from the origin
      for (Vector3d& v : x) v += Vector3d(1e6, 1e6, -1e6);
      break;
    case 2:  // slivers
      for (const std::size_t i : {0, 3}) {
        const double share = signedUnit(random), size = smallPower(random);
        x[i + 2] = x[i] + share * (x[i + 1] - x[i]) + size * random.inCube();
      }
      break;
    case 3: {  // one much smaller than the other
      const double size = smallPower(random);
      for (int i = 3; i < 6; ++i) x[i] = x[0] + size * x[i];
      break;
    }
    case 4:  // on a small grid: parallel, coplanar, coincident
      for (Vector3d& v : x)
        for (double& coordinate : v) coordinate = random.below(3);
      break;
    case 5:  // nearly parallel edges and planes
      for (int i = 3; i < 6; ++i)
        x[i] = x[i - 3] + 0.1 * Vector3d::Ones() + smallPower(random) * x[i];
      break;
    case 7: {  // a tiny one beyond the other's outermost corner
      const int axis = random.below(3);
      const auto before = [axis](const Vector3d& l, const Vector3d& r) {
        return l[axis] < r[axis];
      };
      const Vector3d corner = *std::max_element(x.begin(), x.begin() + 3, before);
      const double size = std::ldexp(1.0, -12 - random.below(30));
      for (int i = 3; i < 6; ++i) {
        x[i] = corner + size * x[i].cwiseAbs();
        x[i][axis] += std::ldexp(1.0, -3 - random.below(14));
      }
      break;
    }
    case 8: {  // edges that cross near an end of one of them
      const double s = signedUnit(random), t = smallPower(random);
      const Vector3d v = x[4] - x[3], normal = (x[1] - x[0]).cross(v);
      x[3] = x[0] + 0.5 * (1 + s) * (x[1] - x[0]) - t * v + signedUnit(random) * normal;
      x[4] = x[3] + v;
      if (random.below(2)) std::swap(x[3], x[4]);
      if (random.below(2))
        for (int i = 0; i < 3; ++i) std::swap(x[i], x[i + 3]);
      break;
    }
    case 9: {  // one smaller than the other, in line with it
      const double size = std::ldexp(1.0, -random.below(15));
      for (int i = 3; i < 6; ++i) x[i] = x[0] + 0.4 * (x[1] - x[0]) + size * x[i];
      break;
    }
    case 10: {  // flat along one axis
      const double size = std::ldexp(1.0, -random.below(140));
      const int axis = random.below(3);
      for (Vector3d& v : x) v[axis] *= size;
      break;
    }
    case 11: {  // a small edge over the middle of a long one
      const Vector3d u = x[1] - x[0], normal = u.cross(x[3]).normalized(),
                     v = std::ldexp(1.0, -5 - random.below(15)) * normal.cross(x[4]);
      x[3] = x[0] + 0.5 * u + signedUnit(random) * normal - 0.4 * v;
      x[4] = x[3] + v;
      x[5] = x[3] + v.norm() * x[5];
      break;
    }
    case 6: {  // any scale
      const double scale = std::ldexp(1.0, random.below(2000) - 1000);
      for (Vector3d& v : x) v *= scale;
      break;
    }
  }
  return x;
}

std::vector<Pair> batchOf(int kind, Random& random) {
  std::vector<Pair> pairs;
  for (int i = 0; i < TrianglePairBatch::kSize; ++i) pairs.push_back(pairOf(kind, random));
  return pairs;
}

/// The thickness is exactly the distance of one of the feature pairs, which must be kept, or a
/// little more.
TEST(ProximityFilter, KeepsEveryPairWithinTheThickness) {
  Random random(3);
  std::size_t within = 0;
  for (int round = 0; round < testing::casesOf(4800); ++round) {
    const int kind = round % kKinds;
    const std::vector<Pair> pairs = batchOf(kind, random);
    const bool distinct = random.below(2) == 0;
    const Pair& chosen = pairs[random.below(TrianglePairBatch::kSize)];
    const int corner = random.below(6);
    const int ofCorner = corner < 3 ? cornerTestOfA(corner) : cornerTestOfB(corner - 3);
    const std::optional<double> ofEdges = distanceOf(chosen, someEdges(random), distinct);
    const double thickness = ofEdges && random.below(3)
                                 ? *ofEdges * (random.below(2) ? 1.0 : 1.0 + smallPower(random))
                                 : distanceOf(chosen, ofCorner, distinct).value();
    const Possible possible = filter(pairs, thickness, distinct);
    for (std::size_t n = 0; n < pairs.size(); ++n) {
      for (int other = 0; other < kTests; ++other) {
        const std::optional<double> distance = distanceOf(pairs[n], other, distinct);
        if (!distance || !(*distance <= thickness)) continue;
        ++within;
        ASSERT_TRUE(possible[n] >> other & 1)
            << "kind " << kind << ", round " << round << ", test " << other;
      }
    }
  }
  EXPECT_GE(within, testing::leastOf(5000));
}

/// Edges whose closest points are ends are kept as well, up to a distance of their own.
TEST(ProximityFilter, KeepsEdgesWithinTheCheckedDistance) {
  Random random(3);
  std::size_t ends = 0;
  for (int round = 0; round < testing::casesOf(2400); ++round) {
    const int kind = round % kKinds;
    std::vector<Pair> pairs = batchOf(kind, random);
    for (Pair& pair : pairs)
      if (random.below(2))  // in one plane
        for (Vector3d& v : pair) v.z() = 0.25 * v.x();
    const Pair& chosen = pairs[random.below(TrianglePairBatch::kSize)];
    const double checked = distanceOf(chosen, someEdges(random), false).value();
    if (checked == 0.0) continue;
    const Possible possible = filter(pairs, checked * (random.below(2) ? 1.0 : 1.5), true, checked);
    for (std::size_t n = 0; n < pairs.size(); ++n)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const int test = edgeTest(i, j);
          if (!(distanceOf(pairs[n], test, false).value() <= checked)) continue;
          ends += !distanceOf(pairs[n], test, true);
          ASSERT_TRUE(possible[n] >> test & 1)
              << "kind " << kind << ", round " << round << ", test " << test;
        }
  }
  EXPECT_GE(ends, testing::leastOf(5000));
}

/// For well-shaped triangles, few pairs beyond the thickness are kept.
TEST(ProximityFilter, DropsNearlyAllPairsBeyondTheThickness) {
  Random random(3);
  const double thickness = 0.03;
  int kept = 0, contacts = 0, all = 0;
  for (int round = 0; round < 300; ++round) {
    const std::vector<Pair> pairs = batchOf(round % 2, random);
    const Possible possible = filter(pairs, thickness, true);
    for (std::size_t n = 0; n < pairs.size(); ++n) {
      all += kTests;
      kept += std::popcount(possible[n] & kAllTests);
      for (int test = 0; test < kTests; ++test) {
        const std::optional<double> distance = distanceOf(pairs[n], test, true);
        contacts += distance && *distance <= thickness;
      }
    }
  }
  EXPECT_GT(contacts, all / 200);
  EXPECT_LT(kept, contacts + contacts / 10);
}

TEST(ProximityFilter, KeepsEveryPairWhereCoordinatesOverflow) {
  const double most = std::numeric_limits<double>::max();
  const Pair x{Vector3d(-most, -most, 0), Vector3d(most, -most, 0), Vector3d(0, most, 0),
               Vector3d(0, 0, 1),         Vector3d(1, 0, 1),        Vector3d(0, 1, 2)};
  const std::vector<Pair> pairs(TrianglePairBatch::kSize, x);
  for (const std::uint32_t bits : filter(pairs, 1.0, true)) EXPECT_EQ(bits & kAllTests, kAllTests);
}

}  // namespace
}  // namespace palpate::test
