#pragma once

#include "Octree/Octree.h"
#include "Core/Assert.h"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace palpate {

inline constexpr std::uint32_t kAllChildren = (1u << kChildren) - 1;  ///< their bits
/// Most nodes that wait while an octree is walked: on each level, those beside the one that was
/// entered, and at the end all siblings.
inline constexpr std::size_t kMostWaiting = (kChildren - 1) * kMaxLevels + kChildren;

/// A walk down an octree, in any order. The search that walks says which children to enter:
///
///   for (Walk walk(octree); walk.next();) {
///     test elements [walk.begin(), walk.end()) of the octree's order
///     if (walk.hasChildren()) walk.enter(bits of the siblings in walk.children())
///   }
///
/// It has no function that is passed to it, so that kernels of any instruction set can use it. The
/// first node is the root, which the search has tested, if it wants to. Nodes may be marked, and
/// know it when their turn comes.
class Walk {
 public:
  explicit Walk(const Octree& octree) : m_blocks(octree.blocks()) {
    PALPATE_ASSERT(octree.isBuilt());
    m_waiting[m_count++] = 0;
  }

  /// Goes on to the next node that was entered. Returns false if there is none.
  bool next() {
    if (m_count == 0) return false;
    const std::uint32_t entry = m_waiting[--m_count];
    m_isMarked = entry & kMark;
    const OctreeNode node = entry & ~kMark;
    const OctreeBlock& block = m_blocks[blockOf(node)];
    const unsigned slot = slotOf(node);
    m_begin = block.begin[slot];
    if (block.isLeaf(slot)) {
      m_children = 0;
      m_end = m_begin + block.count(slot);
    } else {
      m_children = block.child[slot];
      m_end = m_blocks[m_children].begin[0];
    }
    PALPATE_ASSERT(m_begin <= m_end);
    return true;
  }

  std::uint32_t begin() const { return m_begin; }  ///< of the elements that the node itself holds
  std::uint32_t end() const { return m_end; }
  bool isMarked() const { return m_isMarked; }
  bool hasChildren() const { return m_children != 0; }  // the root's block is nobody's child
  const OctreeBlock& children() const { return m_blocks[m_children]; }
  OctreeNode child(unsigned slot) const { return nodeOf(m_children, slot); }

  /// bits: of the children to enter, by slot. marks: of those that get the mark.
  void enter(std::uint32_t bits, std::uint32_t marks = 0) {
    PALPATE_ASSERT(hasChildren() && (bits & ~kAllChildren) == 0);
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<unsigned>(std::countr_zero(bits));
      PALPATE_ASSERT(m_count < kMostWaiting);
      m_waiting[m_count++] = child(slot) | (marks >> slot & 1 ? kMark : 0);
    }
  }

 private:
  static constexpr std::uint32_t kMark = 0x80000000u;

  const OctreeBlock* m_blocks;
  std::uint32_t m_begin, m_end, m_children;
  bool m_isMarked;
  std::size_t m_count = 0;
  std::array<std::uint32_t, kMostWaiting> m_waiting;
};

/// What waits while octrees are walked nearest first. What is entered after one step of the walk is
/// sorted, the least bound on top, above what waited before.
template <class Bound, class Node, std::size_t kMost>
class NearestStack {
 public:
  struct Entry {
    Bound bound;
    Node node;
  };

  void clear() { m_count = m_first = 0; }
  /// Takes the top entry, of those with a bound of at most `most`. Returns false if there is none.
  bool next(Bound most, Entry& entry) {
    while (m_count > 0) {
      entry = m_waiting[--m_count];
      if (entry.bound > most) continue;
      m_first = m_count;
      return true;
    }
    return false;
  }
  void enter(const Node& node, Bound bound) {
    PALPATE_ASSERT(m_count < kMost);
    std::size_t place = m_count++;
    for (; place > m_first && m_waiting[place - 1].bound < bound; --place)
      m_waiting[place] = m_waiting[place - 1];
    m_waiting[place] = {bound, node};
  }

 private:
  std::size_t m_count = 0, m_first = 0;
  std::array<Entry, kMost> m_waiting;
};

/// A walk that goes on with the child of the least bound, of those of the node that was entered
/// last. The search enters children one by one.
template <class Bound>
class NearestWalk {
 public:
  NearestWalk(const Octree& octree, Bound ofRoot) : m_octree(octree) {
    PALPATE_ASSERT(octree.isBuilt());
    enter(0, ofRoot);
  }

  /// Goes on to the next node with a bound of at most `most`.
  bool next(Bound most) {
    typename Waiting::Entry entry;
    if (!m_waiting.next(most, entry)) return false;
    const auto [begin, end] = m_octree.ownRange(entry.node);
    m_begin = begin, m_end = end;
    m_children = m_octree.firstChild(entry.node);
    return true;
  }
  std::uint32_t begin() const { return m_begin; }
  std::uint32_t end() const { return m_end; }
  /// Calls f(child) for each child that is not empty.
  template <class F>
  void forEachChild(F&& f) const {
    for (unsigned slot = 0; m_children != 0 && slot < kChildren; ++slot)
      if (!m_octree.isEmpty(m_children + slot)) f(m_children + slot);
  }
  void enter(OctreeNode child, Bound bound) { m_waiting.enter(child, bound); }

 private:
  using Waiting = NearestStack<Bound, OctreeNode, kMostWaiting>;

  const Octree& m_octree;
  std::uint32_t m_begin = 0, m_end = 0;
  OctreeNode m_children = 0;
  Waiting m_waiting;
};

}  // namespace palpate
