#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>

#include "BoxOctree.h"
#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/Sanitized.h"
#include "Octree/PointQueries.h"
#include "Octree/Traversal.h"

#include <gtest/gtest.h>

#include <string>
#include <type_traits>

namespace palpate {
namespace {

using testing::Boxes;
using testing::BoxOctree;
using testing::FailingAllocation;
using testing::Random;

void expectNotAvailable(auto&& f) { testing::expectRefused(ErrorCode::NotAvailable, "", f); }

/// Every search throws. Validation names the fault unless the octree has forgotten its size.
void expectUnusable(const Octree& octree) {
  EXPECT_FALSE(octree.isBuilt());
  PointQueryStack stack;
  TraversalStack pairs;
  PairSink sink;
  const FloatBox box = testing::boxAbout({0, 0, 0}, 1);
  const TreePair trees{&octree, &octree};
  const NodePair roots[] = {{0, 0}};
  expectNotAvailable([&] { findOverlapping(octree, {}, box, stack); });
  expectNotAvailable([&] {
    forEachOverlapping(
        octree, [](const FloatBox&) { return true; }, [](std::uint32_t, std::uint32_t) {});
  });
  expectNotAvailable([&] { startPairs(trees, 1, pairs); });
  expectNotAvailable([&] { traverse(trees, roots, pairs, sink); });
  EXPECT_EQ(validate(octree, false).empty(), octree.size() == 0);
}

struct Case {
  std::string name;
  Boxes boxes;
  OctreeSettings settings;
};

/// Each way to sort a range: none, by one digit, by two and three, with second keys, and in tasks.
std::vector<Case> cases() {
  Random random(21);
  OctreeSettings few, many;
  few.maxElementsPerLeaf = 4;
  many.maxElementsPerLeaf = 100;
  return {{"one leaf", testing::randomBoxes(random, 3, 0.1), few},
          {"one digit", testing::randomBoxes(random, 200, 0.01), few},
          {"two digits", testing::randomBoxes(random, 900, 0.01), few},
          {"second keys", testing::nestedBoxes(random, 30, 40, 300), few},
          {"tasks", testing::randomBoxes(random, 17'000, 0.001), many}};
}

/// Fails the n-th allocation of a build, for every n. `smaller`: of an octree that was built before
/// with fewer elements, so that it has a part of its memory.
void failEach(const Case& c, const Threads& threads, bool smaller) {
  BoxOctree fresh;
  fresh.build(c.boxes, c.settings, threads);
  ASSERT_EQ(validate(fresh.octree, true), std::vector<std::string>{});
  const Boxes part(c.boxes.begin(), c.boxes.begin() + static_cast<long>(c.boxes.size() / 3 + 1));
  constexpr std::size_t kStep = testing::kSanitized ? 3 : 1;
  std::size_t failures = 0;
  for (std::size_t n = 1;; n += kStep) {
    BoxOctree tree;
    if (smaller) tree.build(part, c.settings, threads);
    tree.prepare(c.boxes);
    const bool threw =
        FailingAllocation::throwsAt(n, [&] { tree.build(c.boxes, c.settings, threads); });
    ASSERT_EQ(threw, FailingAllocation::failed());
    if (!threw) {
      EXPECT_TRUE(tree.octree.isBuilt());
      EXPECT_TRUE(testing::same(tree.octree, fresh.octree));
      break;
    }
    ++failures;
    SCOPED_TRACE(n);
    expectUnusable(tree.octree);
    tree.build(c.boxes, c.settings, threads);
    ASSERT_TRUE(tree.octree.isBuilt());
    ASSERT_TRUE(testing::same(tree.octree, fresh.octree));
    ASSERT_EQ(validate(tree.octree, true), std::vector<std::string>{});
  }
  EXPECT_GE(failures, smaller ? 1 : 5 / kStep);
}

class OctreeFailure : public ::testing::TestWithParam<int> {};

TEST_P(OctreeFailure, FailedAllocationLeavesAnOctreeThatCanBeBuilt) {
  const Threads threads(GetParam());
  for (const Case& c : cases())
    for (const bool smaller : {false, true}) {
      SCOPED_TRACE(c.name + (smaller ? ", after a smaller tree" : ""));
      failEach(c, threads, smaller);
    }
}

INSTANTIATE_TEST_SUITE_P(Threads, OctreeFailure, ::testing::Values(1, 2));

TEST(OctreeFailure, StagesMustRunInTheirOrder) {
  Random random(22);
  const Boxes boxes = testing::randomBoxes(random, 500, 0.01);
  const Threads one(1);
  BoxOctree tree;
  expectUnusable(tree.octree);
  tree.octree.reset(boxes.size());
  EXPECT_EQ(tree.octree.size(), boxes.size());
  expectUnusable(tree.octree);
  tree.build(boxes, {}, one);
  EXPECT_TRUE(tree.octree.isBuilt());
  tree.octree.reset(boxes.size());
  expectUnusable(tree.octree);
}

/// An octree whose first update, or first update of new triangles, failed has no nodes. Those of
/// other geometries are as before.
TEST_P(OctreeFailure, OctreesWithoutNodesAreListedAsEmpty) {
  Random random(25);
  const testing::Mesh first = testing::soup(random, 200, 0.1),
                      second = testing::soup(random, 60, 0.1);
  for (const bool wasUpdated : {false, true}) {
    std::size_t without = 0;
    for (std::size_t n = 1;; ++n) {
      SCOPED_TRACE(n);
      OctreeBasedCD detection(Settings{.threads = GetParam()});
      const GeometryId ids[] = {detection.addTriangleMesh(first.positions, first.triangles),
                                detection.addTriangleMesh(second.positions, second.triangles)};
      if (wasUpdated) {
        detection.update();
        detection.setTriangles(ids[0], second.positions, second.triangles);
        detection.setTriangles(ids[1], first.positions, first.triangles);
      }
      const bool threw = FailingAllocation::throwsAt(n, [&] { detection.update(); });
      const LooseOctree& octree = detection.octree();
      std::size_t with = 0;
      for (const GeometryId id : ids) {
        const bool any = !octree.nodes(id).empty();
        without += !any;
        with += any;
      }
      EXPECT_EQ(octree.geometries().size(), with);
      EXPECT_TRUE(octree.validate().empty());
      if (!threw) break;
    }
    EXPECT_GT(without, 0u);
  }
}

static_assert(!std::is_copy_constructible_v<LooseOctree> &&
              !std::is_copy_assignable_v<LooseOctree>);

}  // namespace
}  // namespace palpate
