#include "BoxOctree.h"
#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

namespace palpate {
namespace {

using testing::Boxes;
using testing::BoxOctree;
using testing::Random;

/// A built octree whose parts can be changed, and nodes of it.
struct Tree : BoxOctree {
  OctreeNode inner = 0;  ///< with own elements and a child block, below the root
  OctreeNode leaf = 0;   ///< with at least two elements
  OctreeNode empty = 0;

  explicit Tree(int directions = 3) {
    Random random(41);
    OctreeSettings settings;
    settings.maxElementsPerLeaf = 4;
    build(testing::nestedBoxes(random, 3, 6, 60), settings, Threads(1));
    if (directions > 3) addDops(directions);
    for (OctreeNode node = 8; node < octree.pool().used() * 8; ++node) {
      const auto [begin, end] = octree.ownRange(node);
      if (octree.isEmpty(node)) {
        empty = node;
      } else if (octree.firstChild(node) == 0) {
        if (end - begin > 1) leaf = node;
      } else if (begin < end && (node & 7) < 7) {
        inner = node;
      }
    }
  }

  OctreeBlock& block(OctreeNode node) {
    return const_cast<OctreeBlock&>(octree.blocks()[node >> 3]);
  }
  std::uint32_t& begin(OctreeNode node) { return block(node).begin[node & 7]; }
  std::uint32_t& child(OctreeNode node) { return block(node).child[node & 7]; }
  std::uint32_t& element(std::size_t place) {
    return const_cast<std::uint32_t&>(octree.order()[place]);
  }
  /// A place in the order that the node holds itself.
  std::uint32_t place(OctreeNode node) const { return octree.ownRange(node).first; }
  /// Changes an element's box and lets the boxes of all nodes follow.
  void setBox(std::uint32_t at, const FloatBox& box) {
    Boxes boxes(octree.size());
    for (std::size_t i = 0; i < boxes.size(); ++i)
      boxes[octree.order()[i]] = i == at ? box : octree.boxes()[i];
    fit(boxes, Threads(1));
  }

 private:
  /// With the bounds of each element's box along the further directions.
  void addDops(int directions) {
    OctreeDops& dops = octree.startDops(directions);
    const auto all = dopDirections(directions);
    for (int k = 3; k < directions; ++k)
      for (std::size_t i = 0; i < octree.size(); ++i) {
        const FloatBox box = octree.boxes()[i];
        dops.lower[k][i] = dops.upper[k][i] = 0;
        for (int j = 0; j < 3; ++j) {
          const auto factor = static_cast<float>(all[k][j]);
          dops.lower[k][i] += std::min(factor * box.lower[j], factor * box.upper[j]);
          dops.upper[k][i] += std::max(factor * box.lower[j], factor * box.upper[j]);
        }
      }
    octree.fitDops(directions);
  }
};

/// Makes one fault in a valid octree, and expects a failure with these words.
void expectFailure(const std::string& words, const std::function<void(Tree&)>& fault,
                   int directions = 3) {
  SCOPED_TRACE(words);
  Tree tree(directions);
  ASSERT_EQ(validate(tree.octree, true), std::vector<std::string>{});
  ASSERT_TRUE(tree.inner > 0 && tree.leaf > 0 && tree.empty > 0);
  fault(tree);
  const std::vector<std::string> failures = validate(tree.octree, true);
  EXPECT_TRUE(std::ranges::any_of(failures, [&](const std::string& f) {
    return f.find(words) != std::string::npos;
  })) << ::testing::PrintToString(failures);
}

TEST(Validate, FindsFaultsOfTheLinks) {
  expectFailure("its range of elements is out of bounds", [](Tree& tree) {
    tree.begin(tree.inner) = tree.begin(tree.octree.firstChild(tree.inner)) + 1;
  });
  expectFailure("its range of elements is out of bounds", [](Tree& tree) {
    tree.begin(tree.leaf) = static_cast<std::uint32_t>(tree.octree.size());
  });
  for (const std::uint32_t child : {0u, 1u, 1u << 30})
    expectFailure("its child block is shared or out of bounds",
                  [=](Tree& tree) { tree.child(tree.inner) = child; });
  expectFailure("its child block refers to another parent",
                [](Tree& tree) { tree.child(0) = tree.child(tree.inner); });
  expectFailure("a node in use has no parent", [](Tree& tree) {  // a leaf with the same elements
    tree.child(tree.inner) =
        OctreeBlock::kLeaf | (tree.begin(tree.inner + 1) - tree.begin(tree.inner));
  });
  expectFailure("all slots of its child block are empty", [](Tree& tree) {
    for (unsigned slot = 0; slot < kChildren; ++slot)
      tree.child(tree.octree.firstChild(tree.inner) + slot) = OctreeBlock::kLeaf;
  });
}

TEST(Validate, FindsFaultsOfTheElements) {
  expectFailure("nodes instead of 1", [](Tree& tree) { ++tree.begin(tree.leaf); });
  expectFailure("in 2 nodes instead of 1", [](Tree& tree) { --tree.begin(tree.leaf); });
  expectFailure("is repeated in the order", [](Tree& tree) { tree.element(0) = tree.element(1); });
}

TEST(Validate, FindsFaultsOfTheBoxes) {
  for (const bool upper : {false, true})
    expectFailure("its fitted box differs", [=](Tree& tree) {
      (upper ? tree.block(tree.leaf).upper : tree.block(tree.leaf).lower)[1][tree.leaf & 7] += 1;
    });
  expectFailure("an empty slot has a box", [](Tree& tree) {
    tree.block(tree.empty).setBox(tree.empty & 7, testing::boxAbout({0, 0, 0}, 1));
  });
  for (const int directions : {7, 9})
    for (const bool upper : {false, true})
      expectFailure(
          "its k-DOP differs",
          [=](Tree& tree) {
            const OctreeDops::Siblings& last =
                tree.octree.dops().block(tree.leaf >> 3)[directions - 4];
            const_cast<float&>((upper ? last.upper : last.lower)[tree.leaf & 7]) += 1;
          },
          directions);
}

/// Elements that move without the cells, as in a refitted octree, are no fault there.
TEST(Validate, FindsElementsOutsideTheirCells) {
  const auto expectOutside = [](const std::string& words, auto&& boxOf, bool inner = false) {
    expectFailure(words, [&](Tree& tree) {
      const OctreeNode node = inner ? tree.inner : tree.leaf;
      const auto [cube, depth] = cellOf(tree.octree, node);
      tree.setBox(tree.place(node), boxOf(cube));
      EXPECT_EQ(validate(tree.octree, false), std::vector<std::string>{});
    });
  };
  const auto about = [](const Cube& cube, double place, double size) {
    std::array<double, 3> centre = cube.lower;
    for (double& c : centre) c += place * cube.edge;
    return testing::boxAbout(centre, size * cube.edge);
  };
  for (const double place : {-0.1, 1.1})
    expectOutside("is outside its cell", [&](const Cube& cube) { return about(cube, place, 0.5); });
  expectOutside("is longer than its cell",
                [&](const Cube& cube) { return about(cube, 0.5, 1.01); });
  expectOutside(
      "fits into a child cell", [&](const Cube& cube) { return about(cube, 0.5, 0.4); }, true);
}

TEST(Validate, AcceptsATreeThatGaveMemoryBack) {
  for (const int directions : {3, 7, 9}) {
    Tree tree(directions);
    tree.octree.releaseMemory();
    EXPECT_EQ(tree.octree.dops().directions, directions);
    EXPECT_EQ(validate(tree.octree, true), std::vector<std::string>{});
  }
}

TEST(Validate, FindsAnEmptyRoot) {
  BoxOctree tree;
  tree.build(Boxes(1, testing::boxAbout({0, 0, 0}, 1)), {}, Threads(1));
  tree.fit(Boxes(1), Threads(1));
  EXPECT_EQ(validate(tree.octree, false), std::vector<std::string>{"node 0: the root is empty"});
}

TEST(Validate, ReportsAtMostTwentyFailures) {
  Random random(42);
  const Boxes boxes = testing::randomBoxes(random, 1000, 0.01);
  BoxOctree tree;
  tree.build(boxes, {}, Threads(1));
  ASSERT_GT(tree.octree.groups().size(), 21u);
  tree.octree.boxes().lower[0].assign(tree.octree.boxes().lower[0].size(), -2);
  EXPECT_EQ(validate(tree.octree, true).size(), 20u);
}

void expectValid(const Boxes& boxes) {
  OctreeSettings settings;
  settings.maxElementsPerLeaf = 2;
  BoxOctree tree;
  tree.build(boxes, settings, Threads(1));
  EXPECT_EQ(validate(tree.octree, true), std::vector<std::string>{});
}

/// The cells of centres are computed in float arithmetic, which may move a centre over a border,
/// also of a root that has no round numbers.
TEST(Validate, AcceptsCentresNextToABorderOfTheirCell) {
  Random random(43);
  for (int round = 0; round < 30; ++round) {
    const auto any = [&] { return testing::uniform(random, -1, 1); };
    Boxes boxes{testing::boxAbout({any(), any(), any()}, 0),
                testing::boxAbout({any(), any(), any()}, 0)};
    BoxOctree ends;
    ends.build(boxes, {}, Threads(1));
    const Cube root = cellOf(ends.octree, 0).cube;
    for (int i = 0; i < 1000; ++i) {
      FloatBox box;
      for (std::size_t k = 0; k < 3; ++k) {
        auto at =
            static_cast<float>(root.lower[k] + root.edge * static_cast<double>(random() % 64) / 64);
        for (auto steps = random() % 3; steps > 0; --steps)
          at = std::nextafter(at, any() < 0 ? -2.0f : 2.0f);
        const auto [least, most] = std::minmax(boxes[0].lower[k], boxes[1].lower[k]);
        box.lower[k] = box.upper[k] = std::clamp(at, least, most);
      }
      boxes.push_back(box);
    }
    SCOPED_TRACE(round);
    expectValid(boxes);
  }
}

TEST(Validate, AcceptsCentresThatRoundToTheBorderOfTheirCell) {
  Random random(42);
  constexpr float kHalf = 0x1p-9f;
  Boxes boxes{testing::boxAbout({0, 0, 0}, 0), testing::boxAbout({1, 1, 1}, 0)};
  for (int i = 0; i < 3000; ++i) {
    FloatBox box;
    for (std::size_t k = 0; k < 3; ++k) {
      const float border = static_cast<float>(1 + random() % 63) / 64;
      // Away from the border by half of float's resolution, up or down.
      box.lower[k] = border - kHalf;
      box.upper[k] = border + kHalf;
      if (random() % 2) box.lower[k] = std::nextafter(box.lower[k], random() % 2 ? 0.0f : 1.0f);
    }
    boxes.push_back(box);
  }
  expectValid(boxes);
}

}  // namespace
}  // namespace palpate
