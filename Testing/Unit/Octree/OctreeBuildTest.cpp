#include "BoxOctree.h"
#include "Octree/Keys.h"

#include <gtest/gtest.h>

namespace palpate {
namespace {

using testing::boxAbout;
using testing::Boxes;
using testing::BoxOctree;

/// The build that Docs/Algorithms/LooseOctree.md follows by hand.
TEST(OctreeBuild, FollowsTheWorkedExample) {
  const Boxes boxes{
      boxAbout({6.5, 6.5, 1.5}, 0.75),     // 0
      boxAbout({6, 2, 2}, 3.5),            // 1
      boxAbout({2.75, 0.75, 0.75}, 0.75),  // 2
      boxAbout({3.25, 0.75, 0.75}, 0.75),  // 3
      boxAbout({1, 1, 1}, 1.5),            // 4
      boxAbout({4, 4, 4}, 7.875),          // 5
  };
  OctreeSettings settings;
  settings.maxElementsPerLeaf = 2;
  BoxOctree tree;
  tree.build(boxes, settings, Threads(1));
  const Octree& octree = tree.octree;

  EXPECT_EQ(octree.rootCube().edge, 8);
  EXPECT_EQ(octree.rootCube().lower, (std::array<double, 3>{0, 0, 0}));

  BoxArrays inGivenOrder;
  inGivenOrder.resize(boxes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      inGivenOrder.lower[k][i] = boxes[i].lower[k];
      inGivenOrder.upper[k][i] = boxes[i].upper[k];
    }
  std::vector<std::uint64_t> keys(boxes.size());
  octreeKeys(inGivenOrder, nullptr, 0, boxes.size(), octree.rootCube(), Key::kMaxLevels,
             keys.data());
  const std::uint64_t digits[] = {0xbbc, 0x900, 0x898, 0x899, 0x880, 0x000};
  for (std::size_t i = 0; i < boxes.size(); ++i) EXPECT_EQ(keys[i], digits[i] << 52 | i);

  const std::vector<std::uint32_t> order{5, 4, 2, 3, 1, 0}, groups{0, 1, 2, 4, 5, 6};
  EXPECT_TRUE(std::ranges::equal(octree.order(), order));
  EXPECT_TRUE(std::ranges::equal(octree.groups(), groups));

  constexpr std::uint32_t kLeaf = OctreeBlock::kLeaf;
  ASSERT_EQ(octree.pool().used(), 3u);
  const auto expectLinks = [&](std::size_t block, std::array<std::uint32_t, 8> begin,
                               std::array<std::uint32_t, 8> child) {
    for (std::size_t slot = 0; slot < 8; ++slot) {
      EXPECT_EQ(octree.blocks()[block].begin[slot], begin[slot]) << block << ", " << slot;
      EXPECT_EQ(octree.blocks()[block].child[slot], child[slot]) << block << ", " << slot;
    }
  };
  expectLinks(0, {0, 6, 6, 6, 6, 6, 6, 6}, {1, kLeaf, kLeaf, kLeaf, kLeaf, kLeaf, kLeaf, kLeaf});
  expectLinks(1, {1, 4, 5, 5, 6, 6, 6, 6},
              {2, kLeaf | 1, kLeaf, kLeaf | 1, kLeaf, kLeaf, kLeaf, kLeaf});
  expectLinks(2, {1, 2, 4, 4, 4, 4, 4, 4},
              {kLeaf | 1, kLeaf | 2, kLeaf, kLeaf, kLeaf, kLeaf, kLeaf, kLeaf});
  EXPECT_EQ(octree.parent(1), 0u);
  EXPECT_EQ(octree.parent(2), 8u);
  EXPECT_EQ(validate(octree, true), std::vector<std::string>{});
}

}  // namespace
}  // namespace palpate
