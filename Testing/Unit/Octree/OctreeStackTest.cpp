#include "BoxOctree.h"
#include "Common/Sanitized.h"
#include "Octree/PointQueries.h"
#include "Octree/Traversal.h"

#include <gtest/gtest.h>

#include <pthread.h>
#include <sys/mman.h>

#include <algorithm>
#include <functional>

namespace palpate {
namespace {

using testing::Boxes;
using testing::BoxOctree;
using testing::Random;

/// Of a thread. On 64-bit ARM it may not be less than 128 KB.
constexpr std::size_t kStack = 512 << 10;

/// A small stack, to which the limits below refer.
#if defined(PALPATE_ADDRESS_SANITIZER) || !defined(NDEBUG)
constexpr std::size_t kSmallStack = kStack;  // frames are several times as large
#else
constexpr std::size_t kSmallStack = 64 << 10;
#endif

/// Runs f in a thread with kStack bytes of stack. Returns how many of them were written.
std::size_t stackOf(std::function<void()> f) {
  constexpr unsigned char kUntouched = 0xa5;
  void* memory = mmap(nullptr, kStack, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  EXPECT_NE(memory, MAP_FAILED);
  auto* bytes = static_cast<unsigned char*>(memory);
  std::fill_n(bytes, kStack, kUntouched);
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  EXPECT_EQ(pthread_attr_setstack(&attributes, memory, kStack), 0);
  pthread_t thread;
  const auto call = [](void* function) -> void* {
    (*static_cast<std::function<void()>*>(function))();
    return nullptr;
  };
  EXPECT_EQ(pthread_create(&thread, &attributes, call, &f), 0);
  EXPECT_EQ(pthread_join(thread, nullptr), 0);
  pthread_attr_destroy(&attributes);
  const auto* touched =
      std::find_if(bytes, bytes + kStack, [](unsigned char byte) { return byte != kUntouched; });
  const auto used = static_cast<std::size_t>(bytes + kStack - touched);
  munmap(memory, kStack);
  return used;
}

/// Stacks of real-time threads are small. The use of the stack does not grow with the octree.
TEST(OctreeStack, IsSmallForTheDeepestTree) {
  if (testing::kThreadSanitizer) GTEST_SKIP() << "ThreadSanitizer keeps its own state on the stack";
  Random random(31);
  // Each third level is sorted by three digits while those above it are still open.
  const Boxes boxes = testing::nestedBoxes(random, 40, 58, 3000);
  OctreeSettings settings;
  settings.maxDepth = 60;
  settings.maxElementsPerLeaf = 1;
  const Threads one(1);
  BoxOctree tree;
  TraversalStack pairs;
  PairSink sink;
  PointQueryStack queries;
  std::size_t found = 0;
  const std::size_t build = stackOf([&] { tree.build(boxes, settings, one); });
  const std::size_t traversal = stackOf([&] {
    const TreePair trees{&tree.octree, &tree.octree};
    sink.start(nullptr, nullptr);
    startPairs(trees, 64, pairs);
    const std::vector<NodePair> starts(pairs.pairs.begin(), pairs.pairs.end());
    traverse(trees, starts, pairs, sink);
    found = sink.kept().size();
  });
  const std::size_t points = stackOf([&] {
    const FloatBox all = testing::boxAbout({0, 0, 0}, 0x1p22);
    findOverlapping(tree.octree, {}, all, queries);
  });
  EXPECT_EQ(validate(tree.octree, true), std::vector<std::string>{});
  int deepest = 0;
  for (std::uint32_t block = 1; block < tree.octree.pool().used(); ++block)
    deepest = std::max(deepest, cellOf(tree.octree, tree.octree.parent(block)).depth + 1);
  EXPECT_GE(deepest, 55);
  EXPECT_GT(found, boxes.size());
  EXPECT_EQ(queries.found.size(), boxes.size());
  // This includes the use of the thread itself, about 4 KB.
  EXPECT_LE(build, kSmallStack * 5 / 8);
  EXPECT_LE(traversal, kSmallStack / 4);
  EXPECT_LE(points, kSmallStack / 4);
  RecordProperty("build", static_cast<int>(build));
  RecordProperty("traversal", static_cast<int>(traversal));
  RecordProperty("points", static_cast<int>(points));
}

}  // namespace
}  // namespace palpate
