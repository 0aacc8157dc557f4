#pragma once

#include "Octree/Keys.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"
#include "Core/ReusableMemory.h"

#include <algorithm>
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

/// The nodes over an order of elements: what a build makes, and how cuts and refits change it. It
/// knows no elements, only their number.
struct OctreeNodes {
  using Range = std::pair<std::uint32_t, std::uint32_t>;  ///< of elements: begin and end
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
  Buffer<std::uint32_t> blockHeap;  ///< of refit(): blocks to fit, the last one first

  FloatBox box(OctreeNode node) const {
    PALPATE_ASSERT(blockOf(node) < pool.used());
    return pool[blockOf(node)].box(slotOf(node));
  }
  bool isEmpty(OctreeNode node) const { return pool[blockOf(node)].isEmpty(slotOf(node)); }
  /// The first of eight consecutive children. 0 for a leaf, as the root is nobody's child.
  OctreeNode firstChild(OctreeNode node) const {
    const OctreeBlock& block = pool[blockOf(node)];
    const unsigned slot = slotOf(node);
    return block.isLeaf(slot) ? 0 : nodeOf(block.child[slot], 0);
  }
  /// The node whose children are in block `block`. For block 0, the root itself.
  OctreeNode parent(std::size_t block) const {
    PALPATE_ASSERT(block < parents.size());
    return parents[block];
  }

  /// The range of elements that a node holds itself.
  Range ownRange(OctreeNode node) const {
    PALPATE_ASSERT(blockOf(node) < pool.used());
    const OctreeBlock& block = pool[blockOf(node)];
    const unsigned slot = slotOf(node);
    const std::uint32_t begin = block.begin[slot];
    return {begin,
            block.isLeaf(slot) ? begin + block.count(slot) : pool[block.child[slot]].begin[0]};
  }
  /// The range of elements that a node and all nodes below it hold.
  Range range(OctreeNode node) const {
    const std::uint32_t begin = ownRange(node).first;
    while (const OctreeNode children = firstChild(node)) {
      node = children + kChildren - 1;
      while (isEmpty(node)) --node;
    }
    return {begin, ownRange(node).second};
  }
  /// The group that holds a place of the order.
  std::uint32_t groupAt(std::uint32_t place) const;
  /// A group with elements near a box, for an element that joins. It is found from the root down,
  /// by the distances of the nodes' boxes.
  std::uint32_t groupNear(const FloatBox&) const;
  /// An element, and the group whose node is to hold it.
  struct Joining {
    std::uint32_t group, element;
  };
  /// Elements [from, from + size) of an order go to `to`.
  struct Move {
    std::uint32_t from, to, size;
  };
  /// Octree::replace() of `size` elements. Returns the moves, and the new places of joining ones.
  std::pair<CountedVector<Move>, CountedVector<std::uint32_t>> replace(
      std::uint32_t size, std::span<const std::uint32_t> places, std::span<const Joining>);
  /// Sets the boxes of groups [first, last), and those of the nodes above them.
  void refit(std::size_t first, std::size_t last, std::span<const FloatBox> groupBoxes);

 private:
  void unlinkIfEmpty(OctreeNode);
  class RangeShifts;
  void shiftRanges(RangeShifts&, std::span<const std::uint32_t> changed);
};

}  // namespace palpate
