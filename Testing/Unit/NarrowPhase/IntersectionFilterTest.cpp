#include "Diagnostics/ContactsByBruteForce.h"
#include "NarrowPhase/IntersectionFilter.h"

#include "Common/EverySimdPath.h"
#include "Common/Sanitized.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace palpate::test {
namespace {

using Eigen::Vector3d;

/// Triangles for tests pair by pair, each with its own corners.
struct Side {
  std::vector<Triangle> triangles;
  std::vector<Vector3d> positions;

  void add(const Corners& corners) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    triangles.push_back({first, first + 1, first + 2});
    positions.insert(positions.end(), corners.begin(), corners.end());
  }
  PlacedTriangles placed() const { return {triangles, positions}; }
};

/// The decisions of the filter for each pair, the same on every SIMD path.
struct Answers {
  std::vector<bool> isKept;
  std::vector<TriangleIntersection> meetings;  ///< none: not known

  bool operator==(const Answers& other) const {
    const auto same = [](const TriangleIntersection& l, const TriangleIntersection& r) {
      return !l.touch() && !r.touch() && l.edgesOfAThroughB == r.edgesOfAThroughB &&
             l.edgesOfBThroughA == r.edgesOfBThroughA;
    };
    return isKept == other.isKept && std::equal(meetings.begin(), meetings.end(),
                                                other.meetings.begin(), other.meetings.end(), same);
  }
};

Answers answersTo(const PlacedTriangles& a, const PlacedTriangles& b, bool self,
                  const std::vector<ElementPair>& pairs) {
  std::vector<Answers> ofPaths;
  for (const std::string& path : testing::EverySimdPath()) {
    Buffer<PossibleIntersection> out = {{{7, 7}, {}}};  // goes
    keepPossiblyIntersecting(a, b, self, pairs, out);
    Answers& answers = ofPaths.emplace_back();
    std::size_t next = 0;
    for (const ElementPair& pair : pairs) {
      const bool isKept =
          next < out.size() && out[next].triangles.a == pair.a && out[next].triangles.b == pair.b;
      answers.isKept.push_back(isKept);
      answers.meetings.push_back(isKept ? out[next].intersection : TriangleIntersection());
      next += isKept;
    }
    EXPECT_EQ(next, out.size()) << path;
    EXPECT_TRUE(answers == ofPaths.front()) << path;
  }
  return ofPaths.front();
}

TEST(IntersectionFilter, KeepsEveryIntersectingPair) {
  Random random(1);
  constexpr int kKinds = static_cast<int>(Kind::Count), kCount = 40000;
  // The largest, the smallest, and where products of three are denormal.
  constexpr int kScales[] = {900, -900, -355};
  Side a, b;
  std::vector<ElementPair> pairs;
  std::vector<bool> isScaled;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    CornersPair pair = makePair(static_cast<Kind>(i % kKinds), random);
    isScaled.push_back(random.below(4) == 0 && i % kKinds < static_cast<int>(Kind::MixedExponents));
    if (isScaled.back()) pair = scaled(pair, kScales[random.below(3)]);
    a.add(pair.first);
    b.add(pair.second);
    pairs.push_back({i, i});
  }
  const auto [isKept, meetings] = answersTo(a.placed(), b.placed(), false, pairs);
  int intersecting[kKinds] = {}, leftOut = 0, apart = 0, known = 0, unscaled = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto cornersOf = [&](const Side& side) {
      return Corners{side.positions[3 * i], side.positions[3 * i + 1], side.positions[3 * i + 2]};
    };
    SignCounts counts;
    const TriangleIntersection truth = intersectTriangles(cornersOf(a), cornersOf(b), counts);
    const bool intersect = truth.intersect();
    ASSERT_TRUE(isKept[i] || !intersect) << i << " of kind " << i % kKinds;
    intersecting[i % kKinds] += intersect;
    if (meetings[i].intersect()) {
      ASSERT_FALSE(truth.touch() || meetings[i].touch()) << i;
      ASSERT_EQ(meetings[i].edgesOfAThroughB, truth.edgesOfAThroughB) << i;
      ASSERT_EQ(meetings[i].edgesOfBThroughA, truth.edgesOfBThroughA) << i;
    }
    if (i % kKinds != 0) continue;
    leftOut += !isKept[i];
    apart += !intersect;
    known += meetings[i].intersect();
    unscaled += intersect && !isScaled[i];
  }
  for (int kind = 0; kind < kKinds; ++kind) EXPECT_GT(intersecting[kind], 20) << kind;
  // For random triangles of the size of their scene:
  EXPECT_GT(leftOut, apart * 7 / 10);
  EXPECT_EQ(known, unscaled);
}

/// Expects that each of so many pairs, whose triangles meet, is kept.
template <class Make>
void expectKept(std::uint32_t count, Make&& make) {
  Side a, b;
  std::vector<ElementPair> pairs;
  for (std::uint32_t i = 0; i < count; ++i) {
    const CornersPair pair = make();
    a.add(pair.first);
    b.add(pair.second);
    pairs.push_back({i, i});
  }
  const std::vector<bool> isKept = answersTo(a.placed(), b.placed(), false, pairs).isKept;
  EXPECT_EQ(std::count(isKept.begin(), isKept.end(), false), 0);
}

/// A corner that touches a plane, or is off by the last bits.
TEST(IntersectionFilter, KeepsCornersOnThePlane) {
  Random random(2);
  expectKept(40000, [&]() -> CornersPair {
    // a's plane is x + y + z = 0 of a grid, exactly; far away and at any scale.
    const double unit = std::ldexp(1.0, random.between(-20, 20));
    const Vector3d far =
        random.below(2) ? Vector3d(0x1p40 * unit * random.onGrid(9)) : Vector3d(0, 0, 0);
    const auto inPlane = [&](double size) {
      const double x = std::floor(size * (random.unit() - 0.5)),
                   y = std::floor(size * (random.unit() - 0.5));
      return Vector3d(far + unit * Vector3d(x, y, -x - y));
    };
    const Corners triangle = cornersOf([&] { return inPlane(0x1p20); });
    Corners other = cornersOf([&] { return Vector3d(inPlane(0x1p20) + unit * Vector3d(1, 1, 1)); });
    other[0] = (triangle[0] + triangle[1]) / 2;
    return {triangle, other};
  });
}

/// A sliver, and a triangle that touches the middle of its side. Along one axis only that corner is
/// far from the sliver's first corner, and only there do products round.
TEST(IntersectionFilter, KeepsCornersThatBoundTheErrorAlone) {
  Random random(4);
  expectKept(20000, [&]() -> CornersPair {
    const int x = random.below(3), y = (x + 1) % 3, z = (x + 2) % 3;
    const auto whole = [&] { return std::floor(0x1p31 * random.unit()) + 1.0; };
    Corners triangle = cornersOf([] { return Vector3d(0, 0, 0); });
    const double across = whole(), up = whole();
    triangle[1][x] = across;
    triangle[1][z] = up;
    triangle[2][x] = 2 * random.between(1, 9) - across;
    triangle[2][z] = 2 * random.between(1, 9) - up;
    triangle[1][y] = 2 * whole();
    triangle[2][y] = 2 * whole();
    if (random.below(2)) triangle[2][x] += 1.0, triangle[1][x] += 1.0;
    const Vector3d normal = triangle[1].cross(triangle[2]);
    const double side = random.below(2) ? 1.0 : -1.0;
    Corners other = cornersOf([&] {
      Vector3d corner(0, 0, 0);
      corner[x] = std::copysign(whole(), side * normal[x]);
      corner[z] = std::copysign(whole(), side * normal[z]);
      return corner;
    });
    other[random.below(3)] = (triangle[1] + triangle[2]) / 2;
    return {triangle, other};
  });
}

TEST(IntersectionFilter, IgnoresCommonCornersOfOneMeshAsTheDefinitionDoes) {
  Random random(3);
  std::size_t found = 0, left = 0;
  for (int repeat = 0; repeat < testing::casesOf(1000); ++repeat) {
    std::vector<Vector3d> positions(6);
    for (Vector3d& p : positions) p = repeat % 2 ? random.onGrid(3) : random.inCube();
    std::vector<Triangle> triangles(3 + random.below(30));
    for (Triangle& t : triangles)
      for (std::uint32_t& v : t) v = static_cast<std::uint32_t>(random.below(6));
    const TriangleMesh mesh{MeshTopology(positions.size(), triangles), positions, positions};
    std::vector<ElementPair> pairs;
    for (std::uint32_t i = 0; i < triangles.size(); ++i)
      for (std::uint32_t j = i; j < triangles.size(); ++j) pairs.push_back({i, j});
    const PlacedTriangles placed{triangles, positions};
    const std::vector<bool> isKept = answersTo(placed, placed, true, pairs).isKept;
    ContactBuffers out;
    findContactsByBruteForce({mesh, mesh, {.method = Method::Intersection}}, out);
    for (const ElementPair& pair : out.intersectingTriangles) {
      const auto same = [&](const ElementPair& p) { return p.a == pair.a && p.b == pair.b; };
      const auto at = std::find_if(pairs.begin(), pairs.end(), same) - pairs.begin();
      ASSERT_TRUE(isKept[static_cast<std::size_t>(at)]) << repeat;
    }
    found += out.intersectingTriangles.size();
    left += static_cast<std::size_t>(std::count(isKept.begin(), isKept.end(), false));
  }
  EXPECT_GE(found, testing::leastOf(3000));
  EXPECT_GE(left, testing::leastOf(3000));
}

}  // namespace
}  // namespace palpate::test
