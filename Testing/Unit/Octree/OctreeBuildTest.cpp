#include "BoxOctree.h"
#include "Octree/Keys.h"

#include <gtest/gtest.h>

#include <algorithm>

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
  octreeKeys(inGivenOrder, nullptr, 0, boxes.size(), octree.rootCube(), Key::kLevels, keys.data());
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

/// Boxes without a size at one point: cells end at the smallest, and no measure divides by 0.
TEST(OctreeBuild, HoldsPointsAtOnePlace) {
  for (const double at : {0.0, 1.0, -3e30}) {
    OctreeSettings settings;
    settings.maxElementsPerLeaf = 4;
    BoxOctree tree;
    tree.build(Boxes(100, boxAbout({at, at, at}, 0.0)), settings, Threads(1));
    EXPECT_EQ(validate(tree.octree, true), std::vector<std::string>{}) << at;
    EXPECT_EQ(tree.octree.looseness(), 1.0);
    EXPECT_GT(tree.octree.bytes(), 100u * sizeof(FloatBox));
  }
}

TEST(OctreeBuild, ReleasesMemoryAndIsBuiltAgain) {
  testing::Random random(3);
  const Boxes many = testing::randomBoxes(random, 5000, 0.01);
  for (const std::size_t size : {5000u, 300u}) {
    const Boxes boxes(many.begin(), many.begin() + static_cast<long>(size));
    BoxOctree tree, fresh;
    tree.build(many, {}, Threads(2));
    tree.build(boxes, {}, Threads(1));
    fresh.build(boxes, {}, Threads(1));
    const std::size_t before = tree.octree.bytes();
    tree.octree.releaseMemory();
    EXPECT_LT(tree.octree.bytes(), before);
    EXPECT_TRUE(testing::same(tree.octree, fresh.octree));
    EXPECT_EQ(validate(tree.octree, true), std::vector<std::string>{});
    tree.build(many, {}, Threads(1));
    fresh.build(many, {}, Threads(1));
    EXPECT_TRUE(testing::same(tree.octree, fresh.octree));
  }
}

TEST(Octree, PartsThatAreFittedOneByOneEqualAWholeFit) {
  testing::Random random(31);
  OctreeSettings few;
  few.maxElementsPerLeaf = 4;
  for (const Boxes& boxes :
       {testing::randomBoxes(random, 3, 0.1), testing::nestedBoxes(random, 30, 20, 300),
        testing::randomBoxes(random, 3000, 0.05)}) {
    testing::BoxOctree tree, fresh;
    tree.build(boxes, few, Threads(1));
    fresh.build(boxes, few, Threads(1));
    Boxes moved = boxes;
    for (FloatBox& box : moved)
      for (std::size_t k = 0; k < 3; ++k) {
        const auto by = static_cast<float>(testing::uniform(random, -0.1, 0.1));
        box.lower[k] += by;
        box.upper[k] += by;
      }
    fresh.fit(moved, Threads(1));
    fresh.octree.measureLooseness();
    const std::size_t groups = tree.octree.groups().size() - 1;
    std::vector<std::pair<std::size_t, std::size_t>> parts;
    for (std::size_t first = 0; first < groups;) {
      const std::size_t last = std::min(groups, first + 1 + random() % 9);
      parts.emplace_back(first, last);
      first = last;
    }
    std::shuffle(parts.begin(), parts.end(), random);
    for (const auto& [first, last] : parts) {
      tree.refit(moved, first, last);
      EXPECT_EQ(validate(tree.octree, false), std::vector<std::string>{});
    }
    tree.octree.addAreas();
    tree.octree.measureLooseness();
    EXPECT_NEAR(tree.octree.looseness(), fresh.octree.looseness(),
                1e-12 * fresh.octree.looseness());
    for (OctreeNode node = 0; node < 8 * tree.octree.pool().used(); ++node) {
      if (tree.octree.isEmpty(node)) continue;
      EXPECT_EQ(tree.octree.box(node).lower, fresh.octree.box(node).lower);
      EXPECT_EQ(tree.octree.box(node).upper, fresh.octree.box(node).upper);
    }
  }
}

/// Elements leave and join nodes, again and again. Nodes become empty, and whole blocks, too.
TEST(OctreeReplace, LeavesAllOtherElementsInTheirNodes) {
  testing::Random random(4);
  std::size_t emptied = 0, unlinked = 0;
  for (int tree = 0; tree < 6; ++tree) {
    const bool nested = tree % 2;
    Boxes boxes = nested ? testing::nestedBoxes(random, 5, 12, 100)
                         : testing::randomBoxes(random, 3000, 0.02);
    OctreeSettings settings;
    settings.maxElementsPerLeaf = 8;
    BoxOctree of;
    of.build(boxes, settings, Threads(1));
    const Octree& octree = of.octree;
    const auto blocks = [&] {
      std::size_t count = 0;
      for (OctreeNode node = 0; node < 8 * octree.pool().used(); ++node)
        count += octree.firstChild(node) != 0;
      return count;
    };
    for (int round = 0; round < 20; ++round) {
      std::vector<std::uint32_t> ids(octree.order().begin(), octree.order().end()), places;
      std::vector<Octree::Joining> joining;
      std::vector<std::vector<std::uint32_t>> contents;
      const std::vector<std::uint32_t> groups(octree.groups().begin(), octree.groups().end());
      const std::size_t linked = blocks();
      // All elements of some groups that follow each other leave.
      const std::size_t count = groups.size() - 1, from = random() % count,
                        to = from + (round % 2 ? random() % (count / 10) : 0);
      for (std::uint32_t g = 0; g < count; ++g) {
        auto& content = contents.emplace_back(ids.begin() + groups[g], ids.begin() + groups[g + 1]);
        if (content.empty()) continue;
        const bool joins = random() % 10 == 0, leave = from <= g && g < to;
        for (std::uint32_t i = groups[g + 1]; i-- > groups[g];)
          if (random() % 10 == 0 || leave) {
            places.push_back(i);
            content.erase(content.begin() + (i - groups[g]));
          }
        if (joins) {
          joining.push_back({g, static_cast<std::uint32_t>(boxes.size())});
          content.push_back(joining.back().element);
          boxes.push_back(boxes[ids[groups[g]]]);
        }
        emptied += content.empty();
      }
      if (places.size() == ids.size()) break;
      std::sort(places.begin(), places.end());
      const std::uint64_t layout = octree.layout();
      const bool keepsBoxes = random() % 2;
      of.octree.replace(places, joining, keepsBoxes);
      EXPECT_EQ(octree.isBuilt(), keepsBoxes);
      EXPECT_NE(octree.layout(), layout);
      if (keepsBoxes) {
        for (std::size_t g = 0; g < count; ++g)
          if (!std::ranges::equal(contents[g],
                                  std::span(ids).subspan(groups[g], groups[g + 1] - groups[g])))
            of.refit(boxes, g, g + 1);
      } else {
        of.fit(boxes, Threads(1));
      }
      ASSERT_EQ(validate(octree, false), std::vector<std::string>{});
      for (std::uint32_t i = 0; i < octree.size(); ++i) {
        EXPECT_EQ(octree.boxes()[i].lower, boxes[octree.order()[i]].lower);
        EXPECT_EQ(octree.boxes()[i].upper, boxes[octree.order()[i]].upper);
      }
      for (std::size_t g = 0; g < contents.size(); ++g)
        EXPECT_TRUE(std::ranges::equal(
            contents[g], octree.order().subspan(octree.groups()[g],
                                                octree.groups()[g + 1] - octree.groups()[g])));
      unlinked += linked - blocks();
    }
  }
  EXPECT_GT(emptied, 100u);
  EXPECT_GT(unlinked, 20u);
}

/// A box joins a group that has elements, and mostly one whose box it overlaps.
TEST(OctreeReplace, FindsGroupsThatAreNear) {
  testing::Random random(5);
  const Boxes boxes = testing::randomBoxes(random, 3000, 0.1);
  BoxOctree tree;
  tree.build(boxes, {}, Threads(1));
  std::size_t overlapping = 0;
  for (const FloatBox& box : boxes) {
    const std::uint32_t group = tree.octree.nodes().groupNear(box);
    const auto groups = tree.octree.groups();
    ASSERT_LT(group + 1, groups.size());
    ASSERT_LT(groups[group], groups[group + 1]);
    overlapping += tree.octree.groupBoxes()[group].overlaps(box);
  }
  EXPECT_GT(overlapping, boxes.size() * 95 / 100);
}

}  // namespace
}  // namespace palpate
