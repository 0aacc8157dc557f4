#pragma once

#include "Octree/Octree.h"

#include <array>
#include <cstdint>

namespace palpate {

/// A range of keys to be sorted by the next digits.
struct Octree::Sorting {
  static constexpr std::size_t kFew = 255,  ///< sorted by one digit
      kMany = 1024,    ///< from here on by kMostDigits, whose bins take time too
      kShared = 8192;  ///< from here on by all threads
  static constexpr int kMostDigits = 3;

  std::uint32_t begin, end;
  int level;                   ///< by what follows it
  int digits = 1;              ///< so many
  const Cube* cube = nullptr;  ///< keys are made in before; null: they are there
  int levels = 0;              ///< of these
  bool first = false;          ///< of all slots, which no keys name yet
};

/// Lays out the nodes over a range of keys, which it sorts on the way, no further than leaves need:
/// the whole tree's top, or one subtree of it in a task of its own.
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
    Cube cube;
    OctreeNode node;
    int depth = 0;
    int levels = 0;  ///< of its keys; 0: there are none
    int level = 0;   ///< of the node among them
    int sorted = 0;  ///< levels of keys that the range is sorted by, at least `level`
    const std::uint32_t* ends = nullptr;  ///< of the parts by the last `digits` of these; null: all
                                          ///< keys are alike in them
    int digits = 0;
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
  void layOutTop(Octree&, Job root, const OctreeSettings&, std::uint32_t taskSize, const Threads&);
  /// Of one task: block 0 holds the children of its root, unless that is a leaf.
  void layOutTask(Octree&, const Job&, const OctreeSettings&);

 private:
  /// The job is used up; not copied, as a load that spans its fresh narrower stores waits for them.
  std::uint32_t layOut(Octree&, Job&);
  std::uint32_t sortMany(Octree&, Job&, Sorting&);
  static std::array<std::uint32_t, 9> partsOf(const Octree&, const Job&);
  std::uint32_t split(Octree&, const Job&, const std::array<std::uint32_t, 9>& begins);
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

}  // namespace palpate
