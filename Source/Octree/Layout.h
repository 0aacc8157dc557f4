#pragma once

#include "Octree/Octree.h"

#include <cstdint>

namespace palpate {

/// Lays out the nodes over a range of sorted keys: the whole tree's top, or one subtree of it in a
/// task of its own.
///
/// The top leaves every subtree of at most taskSize primitives to a task; so the same primitives
/// give the same blocks in the same order for any number of threads.
class Octree::Layout {
 public:
  struct Links {
    std::uint32_t begin[8], child[8];
  };
  /// A node to be laid out.
  struct Job {
    std::uint32_t begin, end;
    int level;  ///< of the node among its keys
    int depth;
    KeyLayout keys;
    Cube cube;
    OctreeNode node;
  };
  /// In `groupNodes`: the group is task (entry & ~kTask)'s, or the own primitives of the task's
  /// root.
  static constexpr OctreeNode kTask = 0x80000000u, kTaskRoot = 0xffffffffu;

  Buffer<Links> links;
  Buffer<OctreeNode> parents;  ///< of each block; block numbers are this layout's own
  Buffer<std::uint32_t> groups;
  Buffer<OctreeNode> groupNodes;
  Buffer<Job> tasks;
  std::uint32_t rootChild = 0;  ///< of a task: its block 0, or a leaf

  /// Of the whole tree: block 0 holds the root alone.
  void layOutTop(Octree&, const Job& root, const OctreeSettings&, std::uint32_t taskSize,
                 const Threads&);
  /// Of one task: block 0 holds the children of its root, unless that is a leaf.
  void layOutTask(Octree&, const Job&, const OctreeSettings&);

 private:
  std::uint32_t layOut(Octree&, Job);
  std::uint32_t split(Octree&, const Job&, std::uint32_t own);
  std::uint32_t leaf(std::uint32_t begin, std::uint32_t end, OctreeNode);
  void clear();
  void reserveGroups();
  void trimGroups() {
    groups.resize(m_groupCount);
    groupNodes.resize(m_groupCount);
  }

  std::size_t m_groupCount = 0;
  std::uint32_t m_mostPerLeaf = 0, m_taskSize = 0;
  int m_maxDepth = 0;
  const Threads* m_threads = nullptr;  ///< none within a task
};

/// Levels of keys that bring a surface of `size` primitives to cells below the leaf's size.
int keyLevels(std::size_t size, const OctreeSettings&, int depth);

}  // namespace palpate
