#include "Mesh/TriangleMesh.h"

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <vector>

// A topology that is cut, beside one that is constructed anew.

namespace palpate {
namespace {

using testing::Random;

void expectSame(const MeshTopology& found, const MeshTopology& truth) {
  EXPECT_EQ(found.vertexCount, truth.vertexCount);
  EXPECT_EQ(found.elements, truth.elements);
  // Edges may have other numbers.
  std::map<Segment, std::uint32_t> edges;
  found.forEachEdge([&](std::uint32_t e) { edges.emplace(found.edges[e], e); });
  ASSERT_EQ(edges.size(), truth.edges.size());
  for (std::uint32_t e = 0; e < truth.edges.size(); ++e) {
    const auto known = edges.find(truth.edges[e]);
    ASSERT_TRUE(known != edges.end());
    EXPECT_EQ(found.edgeOf(known->first), known->second);
    EXPECT_TRUE(std::ranges::equal(found.edgeTriangles[known->second], truth.edgeTriangles[e]));
    if (e > 0) {
      EXPECT_TRUE(found.precedes(edges.at(truth.edges[e - 1]), known->second));
    }
  }
  for (std::uint32_t e = 0; e < found.edges.size(); ++e)
    if (!found.hasEdge(e)) {
      EXPECT_EQ(found.edgeOf(found.edges[e]), kNoEdge);
      EXPECT_TRUE(found.edgeTriangles[e].empty());
    }
  ASSERT_EQ(found.triangleEdges.size(), truth.triangleEdges.size());
  for (std::size_t t = 0; t < truth.triangleEdges.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t e = truth.triangleEdges[t][i];
      EXPECT_EQ(found.triangleEdges[t][i], e == kNoEdge ? kNoEdge : edges.at(truth.edges[e]));
    }
  EXPECT_EQ(found.owned, truth.owned);
  ASSERT_EQ(found.vertexTriangles.size(), truth.vertexTriangles.size());
  for (std::size_t v = 0; v < truth.vertexCount; ++v)
    EXPECT_TRUE(std::ranges::equal(found.vertexTriangles[v], truth.vertexTriangles[v]));
  EXPECT_EQ(found.untestedVertices, truth.untestedVertices);
  EXPECT_EQ(found.isUsed, truth.isUsed);
  EXPECT_EQ(found.hasClosedStar, truth.hasClosedStar);
  EXPECT_EQ(found.openStars, truth.openStars);
  EXPECT_EQ(found.removed, truth.removed);
  EXPECT_EQ(found.disabled, truth.disabled);
  EXPECT_EQ(found.isDisabled, truth.isDisabled);
}

/// Triangles of few vertices, so that many share edges, some are equal and some without area.
std::vector<Triangle> randomTriangles(Random& random, std::size_t count, std::size_t vertices) {
  std::vector<Triangle> triangles;
  for (std::size_t i = 0; i < count; ++i) {
    Triangle& t = triangles.emplace_back();
    for (std::uint32_t& v : t) v = static_cast<std::uint32_t>(random() % vertices);
    if (random() % 4 == 0 && i > 0) t = triangles[random() % i];
  }
  return triangles;
}

TEST(TopologyCut, EqualsATopologyThatIsConstructedAnew) {
  std::size_t large = 0, cuts = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    Random random(seed);
    const bool isBall = seed % 3 == 0;
    const testing::Mesh ball = testing::sphere(3, 4, {0, 0, 0}, 1);
    std::size_t vertices = isBall ? ball.positions.size() : 3 + random() % 20;
    // Cuts of few triangles change the topology, and large ones construct it anew.
    const std::uint64_t few = seed % 2 ? 5 : 60;
    std::vector<Triangle> all =
        isBall ? ball.triangles : randomTriangles(random, random() % (8 * few), vertices);
    MeshTopology topology(vertices, all);
    std::vector<std::uint32_t> removed, disabled;
    for (int cut = 0; cut < 12; ++cut) {
      if (random() % 3 == 0) {
        disabled.clear();
        for (std::uint32_t t = 0; t < all.size(); ++t)
          if (random() % 5 == 0) disabled.push_back(t);
        topology.disable(disabled);
      }
      std::vector<std::uint32_t> gone;
      for (std::uint32_t t = 0; t < all.size(); ++t)
        if (!topology.isRemoved(t) && random() % few == 0) gone.push_back(t);
      vertices += random() % 3;
      std::vector<Triangle> added;
      if (random() % 4) added = randomTriangles(random, random() % (50 / few + 2), vertices);
      // A triangle that is removed and added again is another one.
      for (const std::uint32_t t : gone)
        if (random() % 3 == 0) added.push_back(all[t]);
      large += isLargeCut(gone.size() + added.size(), topology.count());
      const MeshTopology before = topology;
      EdgeChange change;
      topology.cut(gone, added, vertices, [&](const EdgeChange& of) { change = of; });
      // The edges that change are those that the lists of edges say.
      const auto edgesOf = [](const MeshTopology& of) {
        std::vector<Segment> edges;
        of.forEachEdge([&](std::uint32_t e) { edges.push_back(of.edges[e]); });
        std::sort(edges.begin(), edges.end());
        return edges;
      };
      const auto were = edgesOf(before), are = edgesOf(topology);
      const auto subtract = [](const auto& from, const auto& those) {
        CountedVector<Segment> left;
        std::ranges::set_difference(from, those, std::back_inserter(left));
        return left;
      };
      EXPECT_EQ(change.gone, subtract(were, are));
      EXPECT_EQ(change.added, subtract(are, were));
      ++cuts;
      all.insert(all.end(), added.begin(), added.end());
      removed.insert(removed.end(), gone.begin(), gone.end());
      std::sort(removed.begin(), removed.end());
      MeshTopology truth(vertices, all, removed);
      truth.disable(disabled);
      expectSame(topology, truth);
      if (::testing::Test::HasFailure()) FAIL() << "seed " << seed << ", cut " << cut;
    }
  }
  EXPECT_GT(large, cuts / 4);
  EXPECT_LT(large, cuts * 3 / 4);
}

TEST(TopologyCut, RemovedElementsAreNowhere) {
  const testing::Mesh ball = testing::sphere(4, 6, {0, 0, 0}, 1);
  const std::vector<std::uint32_t> removed{0, 7};
  const MeshTopology topology(ball.positions.size(), ball.triangles, removed);
  std::vector<Triangle> left = ball.triangles;
  left.erase(left.begin() + 7);
  left.erase(left.begin());
  const MeshTopology truth(ball.positions.size(), left);
  EXPECT_EQ(topology.count(), left.size());
  EXPECT_EQ(topology.lowest(), 1u);
  EXPECT_EQ(topology.edges, truth.edges);
  EXPECT_EQ(topology.isUsed, truth.isUsed);
  EXPECT_EQ(topology.hasClosedStar, truth.hasClosedStar);
  std::vector<std::uint32_t> elements;
  topology.forEachElement([&](std::uint32_t t) { elements.push_back(t); });
  ASSERT_EQ(elements.size(), left.size());
  for (std::size_t i = 0; i < left.size(); ++i) {
    EXPECT_EQ(topology.elements[elements[i]], left[i]);
    EXPECT_EQ(topology.owned[elements[i]], truth.owned[i]);
    EXPECT_EQ(topology.triangleEdges[elements[i]], truth.triangleEdges[i]);
    EXPECT_TRUE(topology.isEnabled(elements[i]));
  }
  EXPECT_FALSE(topology.isEnabled(0));
}

}  // namespace
}  // namespace palpate
