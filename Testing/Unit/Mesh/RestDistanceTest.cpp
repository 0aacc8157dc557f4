#include "Mesh/RestDistance.h"

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

namespace palpate {
namespace {

using testing::Mesh;
using testing::Random;

/// By Dijkstra's algorithm from each vertex. (A note on two problems in connexion with graphs,
/// Numerische Mathematik 1, 1959.)
IndexLists byDijkstra(const Mesh& mesh, const MeshTopology& topology, double distance) {
  std::vector<std::vector<std::pair<double, std::uint32_t>>> edges(topology.vertexCount);
  for (const auto& [p, q] : topology.edges) {
    const Eigen::Vector3d edge = mesh.positions[p] - mesh.positions[q];
    const double square = edge.squaredNorm();
    const double length = square > 0x1p-900 && square < 0x1p900 ? edge.norm() : edge.stableNorm();
    edges[p].emplace_back(length, q);
    edges[q].emplace_back(length, p);
  }
  CountedVector<std::uint32_t> offsets{0}, items;
  for (std::uint32_t from = 0; from < topology.vertexCount; ++from) {
    std::vector<double> known(topology.vertexCount, std::numeric_limits<double>::infinity());
    std::priority_queue<std::pair<double, std::uint32_t>,
                        std::vector<std::pair<double, std::uint32_t>>, std::greater<>>
        next;
    next.emplace(known[from] = 0.0, from);
    while (!next.empty()) {
      const auto [length, vertex] = next.top();
      next.pop();
      if (length > known[vertex]) continue;
      for (const auto& [edge, other] : edges[vertex])
        if (length + edge < distance && length + edge < known[other])
          next.emplace(known[other] = length + edge, other);
    }
    for (std::uint32_t v = from + 1; v < topology.vertexCount; ++v)
      if (known[v] < distance) items.push_back(v);
    offsets.push_back(static_cast<std::uint32_t>(items.size()));
  }
  return {offsets, std::move(items)};
}

void expectSame(const IndexLists& found, const IndexLists& truth) {
  ASSERT_EQ(found.size(), truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i)
    EXPECT_TRUE(std::ranges::equal(found[i], truth[i])) << i;
}

/// Returns the number of pairs.
std::size_t compare(const Mesh& mesh, double distance) {
  const MeshTopology topology(mesh.positions.size(), mesh.triangles);
  const IndexLists truth = byDijkstra(mesh, topology, distance);
  for (const int threads : {1, 3}) {
    const IndexLists found = verticesWithin(topology, mesh.positions, distance, Threads(threads));
    expectSame(found, truth);
  }
  return truth.itemCount();
}

TEST(RestDistance, MatchesDijkstraOnSheetsOfEveryScale) {
  Random random(3);
  for (const double scale : {1.0, 0x1p-1060, 1e-200, 1e200, 1e299}) {
    Mesh mesh = testing::sheet(15, 0.3, 1);
    for (Eigen::Vector3d& p : mesh.positions)
      p = scale * (p + testing::randomPoint(random, -0.02, 0.02));
    std::size_t last = 0;
    for (const double distance : {0.05, 0.15, 0.4, 1.0, 10.0}) {
      const std::size_t pairs = compare(mesh, scale * distance);
      EXPECT_GE(pairs, last);
      last = pairs;
    }
    EXPECT_EQ(last, mesh.positions.size() * (mesh.positions.size() - 1) / 2);
  }
}

/// Edges from 2^-1000 to 2^900, of length 0, doubled, and vertices without any.
TEST(RestDistance, MatchesDijkstraOnEdgesOfMixedLengths) {
  Random random(4);
  std::size_t pairs = 0;
  for (int round = 0; round < 40; ++round) {
    Mesh mesh;
    for (int v = 0; v < 70; ++v) {
      const double size = std::exp2(round % 2 ? testing::uniform(random, -1000, 900)
                                              : testing::uniform(random, -4, 4));
      mesh.positions.push_back(v % 7 == 3 ? mesh.positions.back()
                                          : size * testing::randomPoint(random, -1, 1));
    }
    for (int t = 0; t < 90; ++t) {
      const auto vertex = [&] { return static_cast<std::uint32_t>(random() % 66); };
      mesh.triangles.push_back({vertex(), vertex(), vertex()});
    }
    const double distance =
        std::exp2(round % 2 ? testing::uniform(random, -900, 900) : testing::uniform(random, 0, 6));
    pairs += compare(mesh, distance);
  }
  EXPECT_GT(pairs, 1000u);
}

TEST(RestDistance, TakesMeshesWithoutEdges) {
  Mesh mesh;
  EXPECT_EQ(compare(mesh, 1.0), 0u);
  mesh.positions.assign(5, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(compare(mesh, 1.0), 0u);
  mesh.triangles = {{0, 1, 2}, {2, 2, 2}};
  EXPECT_EQ(compare(mesh, 0x1p-1074), 3u);
}

TEST(RestDistance, AfterACutIsThatOfTheNewMesh) {
  std::size_t kept = 0, anew = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    Random random(seed);
    Mesh mesh = testing::sheet(9, 0.3, 0);
    for (Eigen::Vector3d& p : mesh.positions) p += testing::randomPoint(random, -0.02, 0.02);
    MeshTopology topology(mesh.positions.size(), mesh.triangles);
    if (seed % 2) topology.disable(std::vector<std::uint32_t>{3, 40, 41, 100});
    const double distance = testing::uniform(random, 0.05, 0.35);
    IndexLists lists = verticesWithin(topology, mesh.positions, distance, Threads(1));
    for (int cut = 0; cut < 4; ++cut) {
      const auto first = static_cast<std::uint32_t>(topology.elements.size());
      std::vector<std::uint32_t> removed;
      for (std::uint32_t t = 0; t < first; ++t)
        if (!topology.isRemoved(t) && random() % (cut == 3 ? 4 : 80) == 0) removed.push_back(t);
      std::vector<Triangle> added;
      for (const std::uint32_t t : removed) {
        const auto [a, b, c] = topology.elements[t];
        if (random() % 2) continue;
        const auto middle = static_cast<std::uint32_t>(mesh.positions.size());
        mesh.positions.push_back((mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3.0);
        added.insert(added.end(), {{a, b, middle}, {b, c, middle}});
      }
      ChangedLists changed;
      topology.cut(removed, added, mesh.positions.size(), [&](const EdgeChange& change) {
        changed =
            verticesWithinAfterCut(topology, change, mesh.positions, distance, lists, Threads(2));
      });
      const IndexLists truth = verticesWithin(topology, mesh.positions, distance, Threads(1));
      if (!changed.areAll) {
        kept += lists.size() - changed.vertices.size();
        lists.reserveMore(truth.size() - lists.size(), changed.lists.itemCount());
      }
      anew += changed.areAll;
      replaceLists(lists, changed);
      expectSame(lists, truth);
    }
  }
  EXPECT_GT(kept, 1000u);
  EXPECT_GT(anew, 50u);
}

}  // namespace
}  // namespace palpate
