#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"
#include "Octree/Forest.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace palpate {
namespace {

using testing::Mesh;
using testing::Random;

constexpr auto kRebuilt = LooseOctree::Update::Rebuilt;

Settings rebuilding(int threads = 1) {
  Settings settings;
  settings.threads = threads;
  settings.octree.update = OctreeUpdate::Rebuild;
  return settings;
}

/// Cells by their bounds, each with its elements: the content of an octree without its node
/// indices.
using TreeContents = std::set<std::pair<std::vector<double>, std::vector<std::uint32_t>>>;

TreeContents treeOf(const OctreeBasedCD& detection, GeometryId geometry) {
  TreeContents tree;
  for (const LooseOctree::Node& node : detection.octree().nodes(geometry)) {
    std::vector<std::uint32_t> elements(node.elements.begin(), node.elements.end());
    std::sort(elements.begin(), elements.end());
    const Eigen::Vector3d low = node.bounds.min(), high = node.bounds.max();
    tree.insert({{low[0], low[1], low[2], high[0], high[1], high[2]}, elements});
  }
  return tree;
}

TEST(Octree, HoldsEachElementOnceWithinItsLooseBounds) {
  Random random(1);
  for (const std::size_t size : {1u, 2u, 17u, 500u, 20000u})
    for (const double extent : {1e-4, 0.02, 0.7}) {
      const Mesh mesh = testing::soup(random, size, extent);
      OctreeBasedCD detection(rebuilding());
      const GeometryId id = detection.addTriangleMesh(mesh.positions, mesh.triangles);
      detection.update();
      ASSERT_EQ(detection.octree().lastUpdate(id), kRebuilt);
      EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
      std::vector<int> holders(size, 0);
      const std::vector<LooseOctree::Node> nodes = detection.octree().nodes(id);
      ASSERT_EQ(nodes.front().parent, kNoElement);
      for (const LooseOctree::Node& n : nodes) {
        for (const std::uint32_t t : n.elements) {
          ++holders[t];
          for (const std::uint32_t corner : mesh.triangles[t]) {
            EXPECT_TRUE(n.looseBounds.contains(mesh.positions[corner]));
            EXPECT_TRUE(n.fittedBox.contains(mesh.positions[corner]));
          }
        }
        if (&n == &nodes.front()) continue;
        ASSERT_LT(n.parent, &n - nodes.data());
        const LooseOctree::Node& parent = nodes[n.parent];
        EXPECT_EQ(parent.depth + 1, n.depth);
        EXPECT_TRUE(parent.fittedBox.contains(n.fittedBox));
        EXPECT_TRUE(parent.bounds.contains(n.bounds.center()));
      }
      EXPECT_TRUE(std::all_of(holders.begin(), holders.end(), [](int n) { return n == 1; }));
    }
}

/// Ever more and smaller triangles towards a point: more levels of cells than a key has.
TEST(Octree, HoldsSizesOfManyLevelsTheSameForAnyNumberOfThreads) {
  Random random(12);
  for (const std::size_t size : {255u, 256u, 1100u, 3000u, 30000u}) {
    Mesh mesh = testing::soup(random, size, 0.2);
    for (std::size_t t = 0; t < size; ++t) {
      const double scale = std::exp2(-testing::randomPoint(random, 0, 24).x());
      for (const std::uint32_t corner : mesh.triangles[t]) mesh.positions[corner] *= scale;
    }
    TreeContents expected;
    for (const int threads : {1, 2, 3}) {
      OctreeBasedCD detection(rebuilding(threads));
      const GeometryId id = detection.addTriangleMesh(mesh.positions, mesh.triangles);
      detection.update();
      EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
      EXPECT_GT(detection.octree().statistics().deepestLevel, size > 1000 ? 18 : 9);
      if (threads == 1) expected = treeOf(detection, id);
      EXPECT_EQ(treeOf(detection, id), expected);
    }
  }
}

TEST(Octree, KeepsMaxDepthAndMaxElementsPerLeaf) {
  Random random(3);
  const Mesh mesh = testing::soup(random, 5000, 0.001);
  for (const int depth : {1, 2, 5, 9, 10, 20})
    for (const int leaf : {1, 8, 100}) {
      Settings settings = rebuilding();
      settings.octree.maxDepth = depth;
      settings.octree.maxElementsPerLeaf = leaf;
      OctreeBasedCD detection(settings);
      const GeometryId id = detection.addTriangleMesh(mesh.positions, mesh.triangles);
      detection.update();
      EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
      EXPECT_LE(detection.octree().statistics().deepestLevel, depth);
      // A leaf has more elements only at the maximum depth, or if all are as large as its cell.
      const std::vector<LooseOctree::Node> nodes = detection.octree().nodes(id);
      std::vector<bool> isLeaf(nodes.size(), true);
      for (const LooseOctree::Node& n : nodes)
        if (n.parent != kNoElement) isLeaf[n.parent] = false;
      for (const LooseOctree::Node& n : nodes) {
        if (isLeaf[static_cast<std::size_t>(&n - nodes.data())] && n.depth < depth &&
            n.elements.size() > static_cast<std::size_t>(leaf)) {
          for (const std::uint32_t t : n.elements) {
            Eigen::AlignedBox3d box;
            for (const std::uint32_t corner : mesh.triangles[t]) box.extend(mesh.positions[corner]);
            EXPECT_GT(box.sizes().maxCoeff(), 0.49 * n.bounds.sizes()[0]);
          }
        }
      }
    }
}

TEST(Octree, UpdatesWithItsGeometryAndReportsHow) {
  using Update = LooseOctree::Update;
  Random random(5);
  const Mesh mesh = testing::sphere(20, 30, {0, 0, 0}, 1.0);
  OctreeBasedCD detection;
  const GeometryId moving = detection.addTriangleMesh(mesh.positions, mesh.triangles);
  const GeometryId still = detection.addTriangleMesh(mesh.positions, mesh.triangles);
  detection.update();
  EXPECT_EQ(detection.octree().lastUpdate(moving), Update::Rebuilt);
  std::vector<Eigen::Vector3d> positions = mesh.positions;
  for (Eigen::Vector3d& p : positions) p += Eigen::Vector3d(100, 0, 0);
  detection.setPositions(moving, positions);
  detection.update();
  EXPECT_EQ(detection.octree().lastUpdate(moving), Update::Refitted);
  EXPECT_EQ(detection.octree().lastUpdate(still), Update::Unchanged);
  EXPECT_EQ(detection.statistics().refittedOctrees, 1u);
  EXPECT_EQ(detection.statistics().unchangedOctrees, 1u);
  EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
  const LooseOctree::Node root = detection.octree().nodes(moving).front();
  for (const Eigen::Vector3d& p : positions) EXPECT_TRUE(root.fittedBox.contains(p));
}

TEST(Octree, RebuildsWhenBoxesGrow) {
  Random random(7);
  const Mesh mesh = testing::soup(random, 2000, 0.01);
  std::vector<Eigen::Vector3d> positions = mesh.positions;
  OctreeBasedCD detection;
  const GeometryId id = detection.addTriangleMesh(positions, mesh.triangles);
  detection.update();
  for (const Triangle& t : mesh.triangles) {  // neighbours separate
    const Eigen::Vector3d away = testing::randomPoint(random, -1, 1);
    for (const std::uint32_t corner : t) positions[corner] += away;
  }
  detection.setPositions(id, positions);
  detection.update();
  EXPECT_EQ(detection.octree().lastUpdate(id), kRebuilt);
  EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
}

TEST(Octree, RebuildsWhereFewElementsJump) {
  Random random(9);
  std::vector<Eigen::Vector3d> positions(20'000);
  for (Eigen::Vector3d& p : positions) p = testing::randomPoint(random, -1, 1);
  OctreeBasedCD detection;
  const GeometryId id = detection.addPointSet(positions, 1e-3);
  detection.update();
  for (int frame = 0; frame < 3; ++frame) {
    for (std::size_t i = 0; i < 200; ++i)
      positions[100 * i + frame] = testing::randomPoint(random, -1, 1);
    detection.setPositions(id, positions);
    detection.update();
    EXPECT_EQ(detection.octree().lastUpdate(id), kRebuilt);
    for (Eigen::Vector3d& p : positions) p += Eigen::Vector3d(0.01, 0, 0);
    detection.setPositions(id, positions);
    detection.update();
    EXPECT_EQ(detection.octree().lastUpdate(id), LooseOctree::Update::Refitted);
  }
}

TEST(Octree, PoolReusesFreedBlocks) {
  Random random(6);
  const Mesh large = testing::soup(random, 20000, 0.005), small = testing::soup(random, 50, 0.1);
  OctreeBasedCD detection(rebuilding());
  const GeometryId id = detection.addTriangleMesh(large.positions, large.triangles);
  detection.update();
  const OctreeStatistics before = detection.octree().statistics();
  detection.setTriangles(id, small.positions, small.triangles);
  detection.update();
  const OctreeStatistics after = detection.octree().statistics();
  EXPECT_EQ(after.blocksAllocated, before.blocksAllocated);
  EXPECT_LT(after.blocksInUse, before.blocksInUse / 10);
  EXPECT_EQ(after.blocksInUse + after.blocksFree, after.blocksAllocated);
  EXPECT_GE(after.blocksAllocated, 64u);
  EXPECT_EQ(after.elements, 50u);
  EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
}

TEST(LooseOctree, ListsTheNodesOfEachGeometryFromTheRoot) {
  OctreeBasedCD detection;
  detection.update();
  EXPECT_TRUE(detection.octree().geometries().empty());
  Random random(51);
  std::vector<GeometryId> ids;
  for (const std::size_t size : {40u, 3000u}) {
    const Mesh mesh = testing::soup(random, size, 0.05);
    ids.push_back(detection.addTriangleMesh(mesh.positions, mesh.triangles));
  }
  detection.addAnalyticalGeometry(Sphere{});
  detection.update();
  const LooseOctree& octree = detection.octree();
  EXPECT_EQ(octree.geometries(), ids);
  const OctreeStatistics statistics = octree.statistics();
  std::size_t nodes = 0, elements = 0;
  for (const GeometryId id : ids) {
    const std::vector<LooseOctree::Node> list = octree.nodes(id);
    ASSERT_FALSE(list.empty());
    EXPECT_EQ(list.front().parent, kNoElement);
    EXPECT_EQ(list.front().depth, 0);
    for (const LooseOctree::Node& node : list) {
      EXPECT_EQ(node.geometry, id);
      elements += node.elements.size();
    }
    nodes += list.size();
  }
  EXPECT_EQ(nodes, statistics.nodesInUse);
  EXPECT_EQ(elements, statistics.elements);
  const GeometryId unknown{99};
  EXPECT_TRUE(octree.nodes(unknown).empty());
  EXPECT_EQ(octree.lastUpdate(unknown), LooseOctree::Update::Unchanged);
}

}  // namespace
}  // namespace palpate
