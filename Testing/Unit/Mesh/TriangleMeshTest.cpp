#include "Mesh/TriangleMesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <span>
#include <vector>

namespace palpate {
namespace {

using Triangles = std::vector<Triangle>;
using Ids = std::vector<std::uint32_t>;

Ids listed(const IndexLists& lists, std::size_t i) { return {lists[i].begin(), lists[i].end()}; }

Segment edgeOf(const Triangle& t, int i) {
  const std::uint32_t p = t[i], q = t[(i + 1) % 3];
  return {std::min(p, q), std::max(p, q)};
}

/// The whole topology again, from the definitions, with sets and maps, separately for each element.
void expectTopology(std::size_t vertexCount, std::span<const Triangle> triangles) {
  const MeshTopology mesh(vertexCount, triangles);
  ASSERT_EQ(mesh.vertexCount, vertexCount);
  ASSERT_TRUE(std::ranges::equal(mesh.elements, triangles));

  std::map<std::uint32_t, std::set<std::uint32_t>> trianglesOfVertex;
  std::map<Segment, std::set<std::uint32_t>> trianglesOfEdge;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (std::uint32_t v : triangles[t]) trianglesOfVertex[v].insert(t);
    for (int i = 0; i < 3; ++i) {
      const Segment edge = edgeOf(triangles[t], i);
      if (edge[0] != edge[1]) trianglesOfEdge[edge].insert(t);
    }
  }

  EXPECT_EQ(mesh.untestedVertices, vertexCount - trianglesOfVertex.size());
  ASSERT_EQ(mesh.vertexTriangles.size(), vertexCount);
  for (std::uint32_t v = 0; v < vertexCount; ++v) {
    const auto& expected = trianglesOfVertex[v];
    EXPECT_EQ(listed(mesh.vertexTriangles, v), Ids(expected.begin(), expected.end())) << v;
  }

  ASSERT_EQ(mesh.edges.size(), trianglesOfEdge.size());
  ASSERT_EQ(mesh.edgeTriangles.size(), mesh.edges.size());
  std::size_t e = 0;
  for (const auto& [edge, holders] :
       trianglesOfEdge) {  // the order of the map is the order of the mesh
    EXPECT_EQ(mesh.edges[e], edge);
    EXPECT_EQ(listed(mesh.edgeTriangles, e), Ids(holders.begin(), holders.end()));
    ++e;
  }

  ASSERT_EQ(mesh.triangleEdges.size(), triangles.size());
  ASSERT_EQ(mesh.owned.size(), triangles.size());
  std::map<std::uint32_t, int> ownersOfVertex;
  std::map<Segment, int> ownersOfEdge;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      const Segment edge = edgeOf(triangles[t], i);
      if (edge[0] == edge[1])
        EXPECT_EQ(mesh.triangleEdges[t][i], kNoEdge);
      else
        EXPECT_EQ(mesh.edges.at(mesh.triangleEdges[t][i]), edge);
      if (mesh.ownsCorner(t, i)) {
        ++ownersOfVertex[triangles[t][i]];
        EXPECT_EQ(t, *trianglesOfVertex[triangles[t][i]].begin());
      }
      if (mesh.ownsEdge(t, i)) {
        ++ownersOfEdge[edge];
        EXPECT_EQ(t, *trianglesOfEdge.at(edge).begin());
      }
    }
    EXPECT_EQ(mesh.owned[t] >> 6, 0);
  }
  for (std::uint32_t v = 0; v < vertexCount; ++v)
    EXPECT_EQ(ownersOfVertex[v], trianglesOfVertex[v].empty() ? 0 : 1) << v;
  EXPECT_EQ(ownersOfEdge.size(), trianglesOfEdge.size());
  for (const auto& [edge, owners] : ownersOfEdge) EXPECT_EQ(owners, 1);
}

Triangles randomSoup(std::uint32_t vertexCount, std::size_t triangleCount, std::mt19937& random) {
  std::uniform_int_distribution<std::uint32_t> vertex(0, vertexCount - 1);
  Triangles triangles(triangleCount);
  for (Triangle& t : triangles) t = {vertex(random), vertex(random), vertex(random)};
  return triangles;
}

TEST(TriangleMesh, SmallMeshes) {
  for (const std::size_t vertexCount : {0u, 1u, 5u}) expectTopology(vertexCount, {});
  for (const Triangles& triangles :
       {Triangles{{2, 0, 1}},
        {{0, 1, 2}, {2, 1, 3}},
        {{0, 1, 2}, {1, 2, 3}},
        {{0, 1, 2}, {3, 2, 1}},
        {{0, 1, 2}, {0, 1, 2}, {2, 1, 0}, {1, 2, 0}},              // the others own nothing
        {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {1, 0, 5}, {0, 1, 6}}})  // an edge of five triangles
    expectTopology(7, triangles);
}

TEST(TriangleMesh, RepeatedIndices) {
  // Every triangle over three vertices, so every pattern of repeats, one by one and all together.
  Triangles all;
  for (std::uint32_t a = 0; a < 3; ++a)
    for (std::uint32_t b = 0; b < 3; ++b)
      for (std::uint32_t c = 0; c < 3; ++c) {
        all.push_back({a, b, c});
        expectTopology(3, Triangles{all.back()});
        expectTopology(4, Triangles{{0, 1, 3}, all.back()});
      }
  expectTopology(3, all);
}

TEST(TriangleMesh, RandomSoups) {
  std::mt19937 random(1);
  for (int run = 0; run < 300; ++run) {
    const std::uint32_t vertexCount = 1 + random() % 40;
    expectTopology(vertexCount, randomSoup(vertexCount, random() % 80, random));
    if (HasFailure()) FAIL() << "run " << run;
  }
}

// One vertex more than 16 bits can number: an edge's key must not wrap.
TEST(TriangleMesh, MoreVerticesThanSixteenBits) {
  constexpr std::uint32_t kVertexCount = 65'537;
  Triangles strip;
  for (std::uint32_t v = 0; v + 2 < kVertexCount; v += 1)
    strip.push_back(v % 2 ? Triangle{v + 1, v, v + 2} : Triangle{v, v + 1, v + 2});
  strip.push_back({0, kVertexCount - 1, 1});
  std::mt19937 random(2);
  std::shuffle(strip.begin(), strip.end(), random);
  expectTopology(kVertexCount, strip);
}

}  // namespace
}  // namespace palpate
