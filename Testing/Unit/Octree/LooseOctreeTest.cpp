#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <vector>

namespace palpate {
namespace {

TEST(LooseOctree, ListsTheNodesOfEachGeometryFromTheRoot) {
  OctreeBasedCD detection;
  detection.update();
  EXPECT_TRUE(detection.octree().geometries().empty());
  testing::Random random(51);
  std::vector<GeometryId> ids;
  for (const std::size_t size : {40u, 3000u}) {
    const testing::Mesh mesh = testing::soup(random, size, 0.05);
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
}

TEST(LooseOctree, HasNothingOfAnUnknownGeometry) {
  testing::Random random(52);
  const testing::Mesh mesh = testing::soup(random, 40, 0.05);
  OctreeBasedCD detection;
  detection.addTriangleMesh(mesh.positions, mesh.triangles);
  detection.update();
  const GeometryId unknown{99};
  EXPECT_TRUE(detection.octree().nodes(unknown).empty());
  EXPECT_EQ(detection.octree().lastUpdate(unknown), LooseOctree::Update::Unchanged);
}

}  // namespace
}  // namespace palpate
