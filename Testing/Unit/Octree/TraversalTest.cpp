#include "Octree/Traversal.h"

#include "BoxOctree.h"
#include "Common/EverySimdPath.h"
#include "Common/TraversedPairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace palpate {
namespace {

using testing::Boxes;
using testing::BoxOctree;
using testing::Random;

/// Boxes on a grid of 1/64, whose sums with a shift are exact.
Boxes gridBoxes(Random& random, std::size_t count) {
  Boxes boxes(count);
  for (FloatBox& box : boxes)
    for (std::size_t k = 0; k < 3; ++k) {
      box.lower[k] = static_cast<float>(random() % 128) / 64;
      box.upper[k] = box.lower[k] + static_cast<float>(random() % 8) / 64;
    }
  return boxes;
}

/// Either end of the boxes may be shifted alone.
TEST(Traversal, FindsTheOverlapsOfShiftedBoxes) {
  Random random(61);
  const Boxes first = gridBoxes(random, 300), second = gridBoxes(random, 200);
  BoxOctree a, b;
  a.build(first, {}, Threads(1));
  b.build(second, {}, Threads(1));
  const std::array<float, 3> shifts[] = {{0, 0, 0}, {0x1p-6f, 0, 0x1p-5f}, {-0.25f, -0.5f, 0}};
  std::size_t found[3][3] = {};
  for (int low = 0; low < 3; ++low)
    for (int high = 0; high < 3; ++high) {
      TreePair trees{&a.octree, &b.octree};
      std::copy_n(shifts[low].begin(), 3, trees.shiftLower.begin());
      std::copy_n(shifts[high].begin(), 3, trees.shiftUpper.begin());
      const std::vector<ElementPair> pairs = testing::traversedPairs(trees, 20);
      std::vector<ElementPair> expected;
      for (std::uint32_t i = 0; i < first.size(); ++i) {
        FloatBox box = first[i];
        for (std::size_t k = 0; k < 3; ++k) {
          box.lower[k] += trees.shiftLower[k];
          box.upper[k] += trees.shiftUpper[k];
        }
        for (std::uint32_t j = 0; j < second.size(); ++j)
          if (box.overlaps(second[j])) expected.push_back({i, j});
      }
      EXPECT_EQ(pairs, expected) << low << ", " << high;
      found[low][high] = pairs.size();
    }
  EXPECT_TRUE(found[0][1] > found[0][0] && found[2][0] > found[0][0] && found[1][0] > 0);
}

/// Each unordered pair once, the lower element first. Triangles that share a vertex are no pair.
TEST(Traversal, FindsThePairsOfOneTree) {
  Random random(62);
  const Boxes boxes = gridBoxes(random, 800);
  OctreeSettings settings;
  settings.maxElementsPerLeaf = 5;
  BoxOctree tree;
  tree.build(boxes, settings, Threads(1));
  std::vector<Triangle> triangles(boxes.size() + BoxArrays::kPadding), ordered = triangles;
  for (Triangle& triangle : triangles)
    for (std::uint32_t& vertex : triangle) vertex = random() % 300;
  for (std::size_t i = 0; i < boxes.size(); ++i) ordered[i] = triangles[tree.octree.order()[i]];
  const auto share = [](const Triangle& s, const Triangle& t) {
    return std::ranges::any_of(s, [&](auto v) { return std::ranges::find(t, v) != t.end(); });
  };
  for (const bool adjacent : {false, true})
    for (const std::string& path : testing::EverySimdPath()) {
      TreePair trees{&tree.octree, &tree.octree};
      if (adjacent) trees.adjacency = ordered.data();
      const std::vector<ElementPair> pairs = testing::traversedPairs(trees, 20);
      std::vector<ElementPair> expected;
      for (std::uint32_t i = 0; i < boxes.size(); ++i)
        for (std::uint32_t j = i + 1; j < boxes.size(); ++j)
          if (boxes[i].overlaps(boxes[j]) && !(adjacent && share(triangles[i], triangles[j])))
            expected.push_back({i, j});
      EXPECT_EQ(pairs, expected) << path;
      EXPECT_GT(expected.size(), 50u);
    }
}

/// A function receives every pair once, in batches that are not empty.
TEST(PairSink, PassesEveryPairInBatches) {
  struct Received {
    std::vector<ElementPair> pairs;
    std::size_t calls = 0, smallest = PairSink::kBatch;
  } received;
  PairSink sink;
  sink.start(
      [](void* context, std::span<const ElementPair> pairs) {
        auto& all = *static_cast<Received*>(context);
        all.pairs.insert(all.pairs.end(), pairs.begin(), pairs.end());
        ++all.calls;
        all.smallest = std::min(all.smallest, pairs.size());
      },
      &received);
  constexpr std::uint32_t kPairs = 3 * PairSink::kBatch;
  for (std::uint32_t i = 0; i < kPairs; ++i) {
    *sink.reserveSpace() = {i, i + 1};
    sink.advance(1);
  }
  sink.flush();
  sink.flush();
  ASSERT_EQ(received.pairs.size(), kPairs);
  for (std::uint32_t i = 0; i < kPairs; ++i) EXPECT_EQ(received.pairs[i].a, i);
  EXPECT_EQ(sink.total(), kPairs);
  EXPECT_GT(received.smallest, 0u);
  EXPECT_GE(received.calls, 3u);
  PairSink keeping;
  keeping.start(nullptr, nullptr);
  *keeping.reserveSpace() = {1, 2};
  keeping.advance(1);
  keeping.flush();
  EXPECT_EQ(keeping.kept().size(), 1u);
}

}  // namespace
}  // namespace palpate
