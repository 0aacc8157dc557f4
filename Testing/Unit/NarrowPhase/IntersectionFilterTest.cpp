#include "NarrowPhase/IntersectionFilter.h"

#include "Core/SimdPath.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace palpate::test {
namespace {

using Eigen::Vector3d;

/// Triangles that are to be tested pair by pair, each with corners of its own.
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

/// The same on every SIMD path.
std::vector<bool> kept(const PlacedTriangles& a, const PlacedTriangles& b, bool self,
                       const std::vector<TrianglePair>& pairs) {
  std::vector<std::vector<bool>> ofPaths;
  for (const std::string& path : simdPaths()) {
    useSimdPath(path);
    Buffer<TrianglePair> out = {{7, 7}};  // stays
    keepPossiblyIntersecting(a, b, self, pairs, out);
    EXPECT_EQ(out.front().a, 7u);
    std::vector<bool>& isKept = ofPaths.emplace_back();
    std::size_t next = 1;
    for (const TrianglePair& pair : pairs) {
      isKept.push_back(next < out.size() && out[next].a == pair.a && out[next].b == pair.b);
      next += isKept.back();
    }
    EXPECT_EQ(next, out.size()) << path;
    EXPECT_EQ(isKept, ofPaths.front()) << path;
  }
  useSimdPath("");
  return ofPaths.front();
}

TEST(IntersectionFilter, KeepsWhateverIntersects) {
  Random random(1);
  constexpr int kKinds = static_cast<int>(Kind::Count), kCount = 40000;
  // The largest, the smallest, and where products of three are denormal.
  constexpr int kScales[] = {900, -900, -355};
  Side a, b;
  std::vector<TrianglePair> pairs;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    CornersPair pair = makePair(static_cast<Kind>(i % kKinds), random);
    if (random.below(4) == 0 && i % kKinds < static_cast<int>(Kind::MixedExponents))
      pair = scaled(pair, kScales[random.below(3)]);
    a.add(pair.first);
    b.add(pair.second);
    pairs.push_back({i, i});
  }
  const std::vector<bool> isKept = kept(a.placed(), b.placed(), false, pairs);
  int intersecting[kKinds] = {}, leftOut = 0, apart = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto cornersOf = [&](const Side& side) {
      return Corners{side.positions[3 * i], side.positions[3 * i + 1], side.positions[3 * i + 2]};
    };
    SignCounts counts;
    const bool intersect = intersectTriangles(cornersOf(a), cornersOf(b), counts).intersect();
    ASSERT_TRUE(isKept[i] || !intersect) << i << " of kind " << i % kKinds;
    intersecting[i % kKinds] += intersect;
    if (i % kKinds != 0) continue;
    leftOut += !isKept[i];
    apart += !intersect;
  }
  for (int kind = 0; kind < kKinds; ++kind) EXPECT_GT(intersecting[kind], 20) << kind;
  EXPECT_GT(leftOut, apart * 6 / 10);  // of random triangles, as large as what they lie in
}

/// A corner within the last bits of the plane that it touches or not.
TEST(IntersectionFilter, KeepsCornersOnThePlane) {
  Random random(2);
  Side a, b;
  std::vector<TrianglePair> pairs;
  for (std::uint32_t i = 0; i < 40000; ++i) {
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
    a.add(triangle);
    b.add(other);
    pairs.push_back({i, i});
  }
  const std::vector<bool> isKept = kept(a.placed(), b.placed(), false, pairs);
  EXPECT_EQ(std::count(isKept.begin(), isKept.end(), false), 0);
}

TEST(IntersectionFilter, OfOneMeshLeavesOutCornersInCommonAsTheDefinitionDoes) {
  Random random(3);
  int found = 0, left = 0;
  for (int repeat = 0; repeat < 3000; ++repeat) {
    std::vector<Vector3d> positions(6);
    for (Vector3d& p : positions) p = repeat % 2 ? random.onGrid(3) : random.inCube();
    std::vector<Triangle> triangles(3 + random.below(30));
    for (Triangle& t : triangles)
      for (std::uint32_t& v : t) v = static_cast<std::uint32_t>(random.below(6));
    const TriangleMesh mesh{MeshTopology(positions.size(), triangles), positions, positions};
    std::vector<TrianglePair> pairs;
    for (std::uint32_t i = 0; i < triangles.size(); ++i)
      for (std::uint32_t j = i; j < triangles.size(); ++j) pairs.push_back({i, j});
    const PlacedTriangles placed{triangles, positions};
    const std::vector<bool> isKept = kept(placed, placed, true, pairs);
    ContactBuffers out;
    findContactsByBruteForce({mesh, mesh, {.method = Method::Intersection}}, out);
    for (const TrianglePair& pair : out.intersectingTriangles) {
      const auto same = [&](const TrianglePair& p) { return p.a == pair.a && p.b == pair.b; };
      const auto at = std::find_if(pairs.begin(), pairs.end(), same) - pairs.begin();
      ASSERT_TRUE(isKept[static_cast<std::size_t>(at)]) << repeat;
    }
    found += static_cast<int>(out.intersectingTriangles.size());
    left += static_cast<int>(std::count(isKept.begin(), isKept.end(), false));
  }
  EXPECT_GT(found, 10000);
  EXPECT_GT(left, 10000);
}

}  // namespace
}  // namespace palpate::test
