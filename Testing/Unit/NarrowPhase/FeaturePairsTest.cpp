#include "NarrowPhase/FeaturePairs.h"

#include "Octree/Traversal.h"

#include "Common/EverySimdPath.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace palpate {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

using Ids = std::array<std::uint32_t, 2>;

std::vector<Ids> sorted(std::span<const FeaturePair> pairs) {
  std::vector<Ids> ids;
  for (const FeaturePair& pair : pairs) ids.push_back({pair.a, pair.b});
  std::sort(ids.begin(), ids.end());
  return ids;
}

bool holds(const Triangle& triangle, std::uint32_t vertex) {
  return std::find(triangle.begin(), triangle.end(), vertex) != triangle.end();
}
bool meet(const Segment& p, const Segment& q) {
  return p[0] == q[0] || p[0] == q[1] || p[1] == q[0] || p[1] == q[1];
}

struct Lists {
  std::vector<Ids> vertexTriangle, triangleVertex, edgeEdge;
};

/// The pairs of features by their definition, of two meshes or of one with itself, for which
/// near(vertices of a, vertices of b) holds.
template <class Near>
Lists pairsOf(const MeshTopology& a, const MeshTopology& b, Near&& near) {
  const bool self = &a == &b;
  Lists all;
  for (std::uint32_t v = 0; v < a.vertexCount; ++v)
    for (std::uint32_t t = 0; t < b.elements.size(); ++t)
      if (!(self && holds(b.elements[t], v)) && near(std::array{v}, b.elements[t]))
        all.vertexTriangle.push_back({v, t});
  for (std::uint32_t t = 0; t < a.elements.size() && !self; ++t)
    for (std::uint32_t v = 0; v < b.vertexCount; ++v)
      if (near(a.elements[t], std::array{v})) all.triangleVertex.push_back({t, v});
  for (std::uint32_t p = 0; p < a.edges.size(); ++p)
    for (std::uint32_t q = self ? p + 1 : 0; q < b.edges.size(); ++q)
      if (!(self && meet(a.edges[p], b.edges[q])) && near(a.edges[p], b.edges[q]))
        all.edgeEdge.push_back({p, q});
  return all;
}

std::vector<ElementPair> everyPair(const MeshTopology& a, const MeshTopology& b) {
  std::vector<ElementPair> pairs;
  for (std::uint32_t i = 0; i < a.elements.size(); ++i)
    for (std::uint32_t j = &a == &b ? i + 1 : 0; j < b.elements.size(); ++j)
      pairs.push_back({i, j});
  return pairs;
}

/// All pairs with overlapping boxes in double, each once, and hardly more.
void expectOverlapping(std::span<const FeaturePair> found, std::vector<Ids> exact,
                       std::size_t more = 0) {
  const std::vector<Ids> ids = sorted(found);
  std::sort(exact.begin(), exact.end());
  EXPECT_TRUE(std::adjacent_find(ids.begin(), ids.end()) == ids.end());
  EXPECT_TRUE(std::includes(ids.begin(), ids.end(), exact.begin(), exact.end()));
  EXPECT_LE(ids.size(), exact.size() + exact.size() / 10'000 + more);
}

struct Moving {
  testing::Mesh mesh;
  std::vector<Vector3d> now;
  std::vector<FloatPoint> floatsBefore, floatsNow;
  MeshTopology topology;

  Moving(testing::Random& random, const Vector3d& offset) : mesh(testing::soup(random, 40, 0.1)) {
    for (Vector3d& p : mesh.positions) p += offset;
    now = mesh.positions;
    for (Vector3d& p : now) p += testing::randomPoint(random, -0.5, 0.5);
    floatsBefore.resize(now.size());
    floatsNow.resize(now.size());
    toFloats(mesh.positions, {offset, 1.0}, floatsBefore.data());
    toFloats(now, {offset, 1.0}, floatsNow.data());
    topology = MeshTopology(now.size(), mesh.triangles);
  }
  template <class Vertices>
  AlignedBox3d box(const Vertices& vertices, double upTo) const {
    AlignedBox3d result;
    for (const std::uint32_t v : vertices)
      result.extend(mesh.positions[v]).extend((1 - upTo) * mesh.positions[v] + upTo * now[v]);
    return result;
  }
};

/// Boxes over [0, upTo], exact up to rounding in double: all overlapping pairs are kept, and few
/// others.
TEST(FeaturePairs, KeepOverlappingPairsUpToAnyTime) {
  testing::Random random(1);
  for (const float upTo : {0.0f, 1e-6f, 0.01f, 0.3f, 0.999f, 1.0f}) {
    for (const double distance : {0.0, 1e4}) {
      const Vector3d offset(distance, -distance, 2 * distance);
      const Moving a(random, offset), b(random, offset);
      FloatPair floats{a.floatsNow.data(), b.floatsNow.data(), a.floatsBefore.data(),
                       b.floatsBefore.data()};
      floats.upTo = upTo;
      FeaturePairs pairs;
      findFeaturePairs(a.topology, b.topology, &floats, everyPair(a.topology, b.topology), pairs);
      const Lists exact = pairsOf(a.topology, b.topology, [&](const auto& p, const auto& q) {
        return a.box(p, upTo).intersects(b.box(q, upTo));
      });
      SCOPED_TRACE(upTo);
      expectOverlapping(pairs.vertexTriangle, exact.vertexTriangle, 2);
      expectOverlapping(pairs.triangleVertex, exact.triangleVertex, 2);
      expectOverlapping(pairs.edgeEdge, exact.edgeEdge, 2);
      EXPECT_GT(exact.edgeEdge.size(), 0u);
    }
  }
}

/// Triangles that reach, up to rounding, to the same coordinate at upTo: one comes from either
/// side, and all their other coordinates overlap. At rest, they are the thickness apart.
TEST(FeaturePairs, KeepBoxesThatTouch) {
  testing::Random random(4);
  const std::vector<Triangle> triangle{{0, 1, 2}};
  const MeshTopology topology(3, triangle), copy = topology;
  std::size_t kept = 0;
  for (int i = 0; i < 4000; ++i) {
    const bool atRest = i % 2;
    const float upTo = static_cast<float>(testing::uniform(random, 0.01, 0.99));
    const int axis = i / 2 % 3;
    const double size = i % 5 ? std::exp2(testing::uniform(random, -20, 20))
                              : std::exp2(testing::uniform(random, -148, -100)),
                 thickness =
                     atRest && i % 7 ? size * std::exp2(testing::uniform(random, -20, 1)) : 0.0;
    std::vector<Vector3d> before(3), now(3), other(3);
    for (auto* positions : {&before, &now, &other})
      for (Vector3d& p : *positions) p = size * testing::randomPoint(random, -1, 1);
    // The vertices that reach furthest up, and down.
    const double u = upTo;
    double reach = -std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < 3; ++k) {
      if (atRest) before[k] = now[k];
      reach = std::max({reach, before[k][axis], (1 - u) * before[k][axis] + u * now[k][axis]});
    }
    double lowest = std::numeric_limits<double>::infinity();
    for (const Vector3d& p : other) lowest = std::min(lowest, p[axis]);
    for (Vector3d& p : other) p[axis] += reach + thickness - lowest;
    for (Vector3d& p : other)
      p[axis] = std::nextafter(std::nextafter(p[axis], -HUGE_VAL), -HUGE_VAL);
    // All other coordinates overlap at the step's start.
    for (int k = 0; k < 3; ++k)
      if (k != axis) {
        before[0][k] = now[0][k] = -2 * size;
        before[1][k] = now[1][k] = 2 * size;
      }
    if (i % 3 == 0)  // reaching down
      for (auto* positions : {&before, &now, &other})
        for (Vector3d& p : *positions) p = -p;
    std::vector<FloatPoint> a(3), b(3), aBefore(3);
    toFloats(now, {}, a.data());
    toFloats(before, {}, aBefore.data());
    toFloats(other, {}, b.data());
    TreePair shift{};
    setShift(shift, {}, thickness);
    FloatPair floats{a.data(), b.data(), nullptr, nullptr, shift.shiftLower, shift.shiftUpper};
    if (!atRest) {
      floats.beforeA = aBefore.data();
      floats.beforeB = b.data();
      floats.upTo = upTo;
    }
    Buffer<ElementPair> candidates{{0, 0}};
    FeaturePairs pairs;
    findFeaturePairs(topology, copy, &floats, candidates, pairs);
    kept += pairs.triangleVertex.size();
    if (atRest) {
      keepOverlapping(topology, copy, floats, candidates);
      ASSERT_EQ(candidates.size(), 1u) << i;
    }
    ASSERT_FALSE(pairs.triangleVertex.empty()) << i;
  }
  EXPECT_LT(kept, 3 * 4000u / 2);  // of three vertices each, few reach
}

/// Triangles over few vertices, so that many share some, degenerate ones among them.
MeshTopology crowded(testing::Random& random, std::uint32_t vertices, std::size_t triangles) {
  const auto any = [&] { return static_cast<std::uint32_t>(random() % vertices); };
  std::vector<Triangle> list(triangles);
  for (Triangle& triangle : list) triangle = {any(), any(), any()};
  return {vertices, list};
}

/// Without boxes: all pairs of the definition, each once, in the same order on every SIMD path.
TEST(FeaturePairs, AreEachTestedOnce) {
  testing::Random random(2);
  for (const std::size_t size : {1, 2, 7, 60, 300}) {
    const MeshTopology a = crowded(random, 40, size), b = crowded(random, 900, 50);
    for (const MeshTopology* second : {&a, &b}) {
      std::vector<ElementPair> candidates = everyPair(a, *second);
      std::shuffle(candidates.begin(), candidates.end(), random);
      const auto isUsed = [](const MeshTopology& mesh, const auto& vertices) {
        return std::all_of(vertices.begin(), vertices.end(),
                           [&](std::uint32_t v) { return mesh.vertexTriangles[v].size() > 0; });
      };
      const auto [vertexTriangle, triangleVertex, edgeEdge] =
          pairsOf(a, *second,
                  [&](const auto& p, const auto& q) { return isUsed(a, p) && isUsed(*second, q); });
      std::vector<FeaturePair> first;
      for (const std::string& path : testing::EverySimdPath()) {
        FeaturePairs pairs;
        findFeaturePairs(a, *second, nullptr, candidates, pairs);
        EXPECT_EQ(sorted(pairs.vertexTriangle), vertexTriangle) << path;
        EXPECT_EQ(sorted(pairs.triangleVertex), triangleVertex) << path;
        EXPECT_EQ(sorted(pairs.edgeEdge), edgeEdge) << path;
        EXPECT_EQ(pairs.owned, vertexTriangle.size() + triangleVertex.size() + edgeEdge.size());
        std::vector<FeaturePair> all(pairs.edgeEdge.begin(), pairs.edgeEdge.end());
        all.insert(all.end(), pairs.vertexTriangle.begin(), pairs.vertexTriangle.end());
        all.insert(all.end(), pairs.triangleVertex.begin(), pairs.triangleVertex.end());
        if (first.empty()) first = all;
        EXPECT_TRUE(
            std::equal(all.begin(), all.end(), first.begin(), first.end(),
                       [](const auto& l, const auto& r) { return l.a == r.a && l.b == r.b; }))
            << path;
      }
    }
  }
}

/// A mesh with itself, and two meshes in frames of their own, whose boxes are at most the thickness
/// apart.
TEST(FeaturePairs, IncludePairsWithinTheThickness) {
  testing::Random random(3);
  constexpr double kThickness = 0.02;
  testing::Mesh sheet = testing::sheet(20, 0, 0), soup = testing::soup(random, 300, 0.1);
  const MeshTopology first(sheet.positions.size(), sheet.triangles),
      second(soup.positions.size(), soup.triangles);
  const Vector3d originA(10, 20, 30), originB(10.25, 20.25, 30);
  for (Vector3d& p : sheet.positions) p += originA;
  for (Vector3d& p : soup.positions) p += originA;
  const auto floatsOf = [](const std::vector<Vector3d>& positions, const Vector3d& origin) {
    std::vector<FloatPoint> floats(positions.size());
    toFloats(positions, {origin, 1.0}, floats.data());
    return floats;
  };
  const auto floatsA = floatsOf(sheet.positions, originA),
             floatsB = floatsOf(soup.positions, originB);
  for (const bool self : {true, false}) {
    const MeshTopology& b = self ? first : second;
    const std::vector<Vector3d>& positionsB = self ? sheet.positions : soup.positions;
    TreePair shift{};
    const Vector3d offset = self ? Vector3d(0, 0, 0) : Vector3d(originA - originB);
    setShift(shift, {offset[0], offset[1], offset[2]}, kThickness);
    const FloatPair floats{floatsA.data(),   self ? floatsA.data() : floatsB.data(),
                           nullptr,          nullptr,
                           shift.shiftLower, shift.shiftUpper};
    FeaturePairs pairs;
    findFeaturePairs(first, b, &floats, everyPair(first, b), pairs);
    const auto boxOf = [](const std::vector<Vector3d>& positions, const auto& vertices) {
      AlignedBox3d box;
      for (const std::uint32_t v : vertices) box.extend(positions[v]);
      return box;
    };
    const auto [vertexTriangle, triangleVertex, edgeEdge] =
        pairsOf(first, b, [&](const auto& p, const auto& q) {
          AlignedBox3d box = boxOf(positionsB, q);
          box.min().array() -= kThickness;
          box.max().array() += kThickness;
          return boxOf(sheet.positions, p).intersects(box);
        });
    EXPECT_GT(edgeEdge.size(), 500u);
    expectOverlapping(pairs.vertexTriangle, vertexTriangle);
    expectOverlapping(pairs.triangleVertex, triangleVertex);
    expectOverlapping(pairs.edgeEdge, edgeEdge);
  }
}

}  // namespace
}  // namespace palpate
