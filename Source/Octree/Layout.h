#pragma once

#include <palpate/Settings.h>

#include "Octree/KeySort.h"
#include "Octree/Octree.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"

#include <array>
#include <cstdint>

namespace palpate {

/// The nodes over a range of keys: the top of the whole tree, or one subtree that is a task of its
/// own. Sorts the keys as it lays out nodes, only as far as leaves need.
///
/// The top leaves each subtree of at most taskSize elements to a task. Which subtrees become tasks
/// depends on the elements only. The same elements therefore give the same blocks in the same order
/// for any number of threads.
class Layout {
 public:
  struct Links {
    std::uint32_t begin[kChildren], child[kChildren];
  };
  /// A node that is to be laid out.
  struct Job {
    std::uint32_t begin, end;
    Cube cube;
    OctreeNode node;
    int depth;
    int levels;  ///< number of levels of its keys; 0: there are none yet
    int level;   ///< level of the node within its keys
    int sorted;  ///< levels of the keys by which the range is sorted, at least `level`
    /// Where the node's PartEnds begin; kEqualDigits: all keys have the same digits.
    std::uint32_t ends;
  };
  static constexpr std::uint32_t kEqualDigits = 0xffffffffu;
  static Job rootJob(std::uint32_t size, const Cube& cube) {
    return {0, size, cube, 0, 0, 0, 0, 0, kEqualDigits};
  }
  /// Values in `groupNodes`. kTask | i: the entry stands for all groups of task i. kTaskRoot: the
  /// group has the own elements of the task's root.
  static constexpr OctreeNode kTask = 0x80000000u, kTaskRoot = 0xffffffffu;

  /// The links of each block, in depth-first order. Block numbers are local to this layout.
  Buffer<Links> links;
  Buffer<OctreeNode> parents;     ///< of each block
  Buffer<std::uint32_t> groups;   ///< where each group begins
  Buffer<OctreeNode> groupNodes;  ///< the node of each group
  Buffer<Job> tasks;
  std::uint32_t rootChild = 0;  ///< of a task: its block 0, or kLeaf and a count

  /// Lays out the top of the whole tree; block 0 holds the root alone. `ends` is scratch.
  void layOutTop(const KeySort&, const Job& root, const OctreeSettings&, std::uint32_t taskSize,
                 Buffer<std::uint32_t>& ends, const Threads&);
  /// Lays out one task; block 0 holds the children of its root, unless the root is a leaf.
  void layOutTask(const KeySort&, const Job&, const OctreeSettings&, Buffer<std::uint32_t>& ends);

  std::size_t bytes() const;

 private:
  static constexpr int kMaxDepth = kMaxLevels - 1;  ///< as OctreeSettings::maxDepth

  /// A node whose children are being laid out.
  struct OpenNode {
    Job job;
    std::array<std::uint32_t, kChildren + 1> begins;  ///< of the octants, and the end of the last
    std::uint32_t link;  ///< its child block, or for other nodes the value of the parent's slot
    std::uint32_t endsBefore;  ///< size of the scratch before its range was sorted
    unsigned nextSlot;
  };

  void start(const OctreeSettings&, std::uint32_t taskSize, Buffer<std::uint32_t>& ends,
             const Threads*);
  std::uint32_t layOut(const KeySort&, const Job&);
  bool open(const KeySort&, OpenNode&);
  void sort(const KeySort&, OpenNode&);
  void findParts(const KeySort&, OpenNode&) const;
  bool nextChild(OpenNode& parent, Job& child);
  std::uint32_t addBlock(const OpenNode&);
  std::uint32_t addLeaf(std::uint32_t begin, std::uint32_t end, OctreeNode);
  void reserveGroups();
  void finish();

  std::size_t m_groupCount = 0;
  std::uint32_t m_maxPerLeaf = 0, m_taskSize = 0;
  int m_maxDepth = 0;
  Buffer<std::uint32_t>* m_ends = nullptr;  ///< PartEnds of all sorted ranges that are still open
  const Threads* m_threads = nullptr;       ///< null within a task
};

}  // namespace palpate
