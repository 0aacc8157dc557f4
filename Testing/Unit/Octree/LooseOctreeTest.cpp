#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace palpate {
namespace {

bool exists(const LooseOctree& octree, std::uint32_t node) {
  try {
    octree.node(LooseOctree::NodeId{node});
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::IndexOutOfRange);
    return false;
  }
  return true;
}

TEST(LooseOctree, HasTheNodesThatItListsAndNoOthers) {
  OctreeBasedCD detection;
  detection.update();
  EXPECT_TRUE(detection.octree().nodes().empty());
  EXPECT_FALSE(exists(detection.octree(), 0));
  testing::Random random(51);
  for (const std::size_t size : {40u, 3000u}) {
    const testing::Mesh mesh = testing::soup(random, size, 0.05);
    detection.addTriangleMesh(mesh.positions, mesh.triangles);
  }
  detection.update();
  const LooseOctree& octree = detection.octree();
  const std::vector<LooseOctree::NodeId> nodes = octree.nodes();
  const auto ids = static_cast<std::uint32_t>(octree.statistics().nodesAllocated) + 100;
  std::size_t found = 0;
  for (std::uint32_t node = 0; node < ids; ++node) {
    const bool isListed =
        std::find(nodes.begin(), nodes.end(), LooseOctree::NodeId{node}) != nodes.end();
    ASSERT_EQ(exists(octree, node), isListed) << node;
    found += isListed;
  }
  EXPECT_EQ(found, nodes.size());
}

TEST(LooseOctree, HasNothingOfAnUnknownGeometry) {
  testing::Random random(52);
  const testing::Mesh mesh = testing::soup(random, 40, 0.05);
  OctreeBasedCD detection;
  detection.addTriangleMesh(mesh.positions, mesh.triangles);
  detection.update();
  const GeometryId unknown{99};
  EXPECT_TRUE(detection.octree().nodes(unknown).empty());
  EXPECT_FALSE(detection.octree().root(unknown).has_value());
  EXPECT_EQ(detection.octree().lastUpdate(unknown), LooseOctree::Update::Unchanged);
}

}  // namespace
}  // namespace palpate
