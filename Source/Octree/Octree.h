#pragma once

#include <palpate/LooseOctree.h>
#include <palpate/Settings.h>

#include "Octree/Dops.h"
#include "Octree/Keys.h"
#include "Math/Box.h"
#include "Core/ReusableMemory.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

namespace palpate {

/// Eight siblings with their fitted boxes side by side, so that one SIMD comparison tests all
/// eight.
///
/// Slot i is the child in octant i (bit 0: x, 1: y, 2: z). The elements of a slot in use start at
/// begin[i] of the tree's order. A leaf has `count(i)` elements. For any other slot, its own
/// elements come first and end where the first element of its child block begins. The box of an
/// empty slot overlaps nothing. Some slot of a child block is not empty.
struct alignas(64) OctreeBlock {
  static constexpr std::uint32_t kLeaf = 0x80000000u;

  float lower[3][kChildren];
  float upper[3][kChildren];
  std::uint32_t begin[kChildren];
  std::uint32_t child[kChildren];  ///< a block, or kLeaf | number of elements

  bool isLeaf(unsigned slot) const { return child[slot] & kLeaf; }
  std::uint32_t count(unsigned slot) const {
    PALPATE_ASSERT(isLeaf(slot));
    return child[slot] & ~kLeaf;
  }
  bool isEmpty(unsigned slot) const { return child[slot] == kLeaf; }
  FloatBox box(unsigned slot) const {
    PALPATE_ASSERT(slot < kChildren);
    return {{lower[0][slot], lower[1][slot], lower[2][slot], 0},
            {upper[0][slot], upper[1][slot], upper[2][slot], 0}};
  }
  void setBox(unsigned slot, const FloatBox& box) {
    PALPATE_ASSERT(slot < kChildren);
    for (int k = 0; k < 3; ++k) {
      lower[k][slot] = box.lower[k];
      upper[k][slot] = box.upper[k];
    }
  }
};
static_assert(sizeof(OctreeBlock) == 256,
              "four cache lines: two of bounds on each side, one of links");

/// Blocks, numbered from 0. The pool grows by at least kGrowth blocks and by half of its size.
/// Blocks that a smaller tree does not need stay in the pool as free blocks.
///
/// Before a tree that is being built has blocks, their memory is lent to other elements.
class BlockPool {
 public:
  static constexpr std::size_t kGrowth = 64;

  /// Replaces all blocks by `count` elements. Their values are indeterminate.
  template <class T>
  std::span<T> lend(std::size_t count) {
    m_blocks = {};
    reserve((count * sizeof(T) + sizeof(OctreeBlock) - 1) / sizeof(OctreeBlock));
    return m_memory.start<T>(count);
  }
  /// Replaces the contents by so many blocks. Their values are indeterminate.
  void start(std::size_t blocks) {
    m_blocks = {};
    reserve(blocks);
    m_blocks = m_memory.start<OctreeBlock>(blocks);
  }
  void releaseMemory() { m_blocks = m_memory.shrink(m_blocks); }  ///< keeps the blocks
  std::size_t used() const { return m_blocks.size(); }
  std::size_t free() const { return allocated() - used(); }
  std::size_t allocated() const { return m_memory.bytes() / sizeof(OctreeBlock); }
  OctreeBlock& operator[](std::size_t i) { return m_blocks[i]; }
  const OctreeBlock& operator[](std::size_t i) const { return m_blocks[i]; }
  OctreeBlock* data() { return m_blocks.data(); }
  const OctreeBlock* data() const { return m_blocks.data(); }

 private:
  void reserve(std::size_t blocks) {
    if (const std::size_t had = allocated(); blocks > had)
      m_memory.reserve(std::max(blocks, had + std::max(kGrowth, had / 2)) * sizeof(OctreeBlock));
  }

  ReusableMemory m_memory;
  std::span<OctreeBlock> m_blocks;
};

/// A node, by its block and its slot there. The root is node 0, alone in block 0.
using OctreeNode = std::uint32_t;
constexpr std::uint32_t blockOf(OctreeNode node) { return node / kChildren; }
constexpr unsigned slotOf(OctreeNode node) { return node % kChildren; }
constexpr OctreeNode nodeOf(std::uint32_t block, unsigned slot) { return block * kChildren + slot; }

/// The result of a build: the nodes over an order of elements.
struct OctreeNodes {
  Cube rootCube{};
  BlockPool pool;
  Buffer<OctreeNode> parents;  ///< of each block
  /// One group for each leaf, and for the own elements of each other node. Group g has elements
  /// [groups[g], groups[g + 1]) of the order. Groups are empty only after Octree::replace().
  Buffer<std::uint32_t> groups;
  Buffer<OctreeNode> groupNodes;  ///< the node of each group
  /// Part i of the build made blocks [partBlocks[i], partBlocks[i + 1]). Part 0 is the top, the
  /// others are tasks.
  Buffer<std::uint32_t> partBlocks;
};

class OctreeBuilder;

/// The loose octree of one geometry. It works on boxes and positions in an order, and does not
/// depend on meshes.
///
/// An octree is in one of three stages:
///
///   empty      after reset(), and, with a size of 0, after a reset() or build() that failed.
///   laid out   after build(), and after a fit() that failed. Nodes hold their elements, in a
///              new order(); their boxes are not known yet.
///   built      after fit(). Searches work in this stage only, and throw in the others.
///
/// A frame that rebuilds the tree goes through all stages. The caller writes boxes() in the order()
/// of the last frame and calls build(). It then writes boxes() in the new order(), and
/// groupBoxes(), and calls fit(). A frame that refits the tree starts after build().
///
/// After an exception from any member, the octree can be reset() and built like a new one.
class Octree {
 public:
  Octree();
  Octree(const Octree&) = delete;
  Octree& operator=(const Octree&) = delete;
  ~Octree();

  /// Forgets the tree; `order()` is then 0, 1, ..., without these, which ascend, and has `size`
  /// elements.
  void reset(std::size_t size, std::span<const std::uint32_t> without = {});
  /// Becomes a copy of a built octree, or of one without elements, for searches only. All copies in
  /// one object must be of one octree. If that was only fitted since the last copy, its layout is
  /// not copied again.
  void copy(const Octree& other);

  std::size_t size() const { return m_order.size(); }
  std::span<const std::uint32_t> order() const {
    return m_order;
  }  ///< element ids as the nodes hold them
  BoxArrays& boxes() { return m_boxes; }
  const BoxArrays& boxes() const { return m_boxes; }
  std::span<const std::uint32_t> groups() const { return m_nodes.groups; }  ///< see OctreeNodes
  FloatBox* groupBoxes() { return m_groupBoxes.data(); }

  /// Lays out the nodes. Afterwards order() is new, and boxes() are still in the old order. bounds:
  /// of all boxes. bulk: the extent about 0 of most boxes. keys: scratch, one for each element.
  void build(const FloatBox& bounds, double bulk, const OctreeSettings&,
             std::span<std::uint64_t> keys, const Threads&);
  /// An element, and the group whose node is to hold it.
  struct Joining {
    std::uint32_t group, element;
  };
  /// Elements [from, from + size) of an order go to `to`.
  struct Move {
    std::uint32_t from, to, size;
  };
  /// Of a built octree: removes the elements at these places of the order, and adds others at the
  /// ends of their groups, which had elements. Both ascend, and together they are not empty; some
  /// element is left. Groups may become empty. order() is then new, and nodes may hold elements
  /// that a build would put elsewhere. Returns the moves of the elements that stay, for move().
  /// keepsBoxes: boxes of elements that stay are known, too, and the caller calls refit() for all
  /// groups of these places and elements. Otherwise no box is known, as after build().
  /// Cost     moves of the order, and of the boxes, behind the first place, and one look at each
  ///          node behind it.
  CountedVector<Move> replace(std::span<const std::uint32_t> places,
                              std::span<const Joining> joining, bool keepsBoxes);
  /// Makes the moves that replace() returned, of elements in the old order.
  template <class T>
  static void move(T* elements, std::span<const Move> moves) {
    // Neither the sources nor the targets overlap each other, and both ascend.
    for (auto m = moves.rbegin(); m != moves.rend(); ++m)
      if (m->to > m->from)
        std::copy_backward(elements + m->from, elements + m->from + m->size,
                           elements + m->to + m->size);
    for (const Move& m : moves)
      if (m.to < m.from) std::copy_n(elements + m.from, m.size, elements + m.to);
  }
  /// Of a built octree: a group with elements near a box, for an element that joins. It is found
  /// from the root down, by the distances of the nodes' boxes.
  std::uint32_t groupNear(const FloatBox&) const;
  /// Computes the boxes of all nodes from the groups' boxes.
  void fit(const Threads&);
  /// Of a built octree: the same for groups [first, last), whose boxes in groupBoxes() are new.
  /// Cost     their number, and that of the nodes above them.
  void refit(std::size_t first, std::size_t last);
  void measureLooseness();  ///< of the fitted boxes
  void addAreas();          ///< call before measureLooseness(), after refit()
  /// Of a built octree: makes room for the elements' bounds along the directions after the axes.
  /// The caller writes them in the order() and calls fitDops(), which computes those of all nodes.
  /// Until then, and after any change of the octree, there are none.
  OctreeDops& startDops(int directions);
  void fitDops(int directions);

  void releaseMemory();  ///< gives back scratch and free blocks

  bool isBuilt() const { return m_stage == Stage::Built; }
  std::uint64_t layout() const { return m_layout; }  ///< changes with each change of order()
  /// Throws unless isBuilt(). Every search starts with this.
  void requireBuilt() const {
    if (!isBuilt()) throwNotBuilt();
  }

  /// The sum of the leaves' half areas divided by that of a sample of their elements. It measures
  /// how loose the fitted boxes are, and grows as a refitted tree degrades. Motion and scaling of
  /// the whole do not change it.
  double looseness() const { return m_looseness; }
  /// Whether the leaves are at most kMaxLoosening times as loose as at their tightest since the
  /// build. Otherwise the tree should be built again.
  bool isTight() const { return m_looseness <= kMaxLoosening * m_leastLooseness; }

  const OctreeDops& dops() const { return m_dops; }
  const OctreeBlock* blocks() const { return m_nodes.pool.data(); }
  const BlockPool& pool() const { return m_nodes.pool; }
  const Cube& rootCube() const { return m_nodes.rootCube; }
  std::size_t bytes() const;
  FloatBox box(OctreeNode node) const {
    PALPATE_ASSERT(blockOf(node) < m_nodes.pool.used());
    return blocks()[blockOf(node)].box(slotOf(node));
  }
  bool isEmpty(OctreeNode node) const { return blocks()[blockOf(node)].isEmpty(slotOf(node)); }
  /// The first of eight consecutive children. 0 for a leaf, as the root is nobody's child.
  OctreeNode firstChild(OctreeNode node) const {
    const OctreeBlock& block = blocks()[blockOf(node)];
    const unsigned slot = slotOf(node);
    return block.isLeaf(slot) ? 0 : nodeOf(block.child[slot], 0);
  }
  /// The node whose children are in block `block`. For block 0, the root itself.
  OctreeNode parent(std::size_t block) const {
    PALPATE_ASSERT(block < m_nodes.parents.size());
    return m_nodes.parents[block];
  }

  /// The range of elements that a node holds itself.
  std::pair<std::uint32_t, std::uint32_t> ownRange(OctreeNode node) const {
    PALPATE_ASSERT(blockOf(node) < m_nodes.pool.used());
    const OctreeBlock& block = m_nodes.pool[blockOf(node)];
    const unsigned slot = slotOf(node);
    const std::uint32_t begin = block.begin[slot];
    return {begin, block.isLeaf(slot) ? begin + block.count(slot)
                                      : m_nodes.pool[block.child[slot]].begin[0]};
  }
  /// The range of elements that a node and all nodes below it hold.
  std::pair<std::uint32_t, std::uint32_t> range(OctreeNode node) const {
    const std::uint32_t begin = ownRange(node).first;
    while (const OctreeNode children = firstChild(node)) {
      node = children + kChildren - 1;
      while (isEmpty(node)) --node;
    }
    return {begin, ownRange(node).second};
  }

 private:
  static constexpr double kMaxLoosening = 1.5;
  enum class Stage { Empty, LaidOut, Built };
  std::uint32_t groupAt(std::uint32_t place) const;
  void unlinkIfEmpty(OctreeNode);
  class RangeShifts;
  void shiftRanges(const RangeShifts&, std::span<const std::uint32_t> changed);
  [[noreturn]] static void throwNotBuilt();

  Stage m_stage = Stage::Empty;
  std::uint64_t m_layout = 0;
  Buffer<std::uint32_t> m_order;
  BoxArrays m_boxes;
  OctreeDops m_dops;
  OctreeNodes m_nodes;
  std::unique_ptr<OctreeBuilder> m_builder;  ///< keeps its scratch; null before the first build
  Buffer<FloatBox> m_groupBoxes;
  Buffer<double> m_groupAreas;        ///< one sum for each chunk of groups
  Buffer<std::uint32_t> m_blockHeap;  ///< of refit(): blocks to fit, the last one first
  double m_looseness = 0, m_leastLooseness = 0;
  bool m_isUnmeasured = false;  ///< looseness was not measured since the build
};

}  // namespace palpate
