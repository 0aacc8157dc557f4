#pragma once

#include <palpate/LooseOctree.h>
#include <palpate/Settings.h>

#include "Core/Arena.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"
#include "Math/Box.h"
#include "Octree/Keys.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

namespace palpate {

/// Eight siblings: their fitted boxes side by side, so that one SIMD comparison prunes all eight.
///
/// Slot i is the child in octant i (bit 0: x, 1: y, 2: z). A slot in use holds elements [begin,
/// ...) of the tree's order: as a leaf `count(i)` of them; otherwise its own elements come first
/// and end where child block's first begins. An empty slot's box overlaps nothing.
struct alignas(64) OctreeBlock {
  static constexpr std::uint32_t kLeaf = 0x80000000u;

  float lower[3][8];
  float upper[3][8];
  std::uint32_t begin[8];
  std::uint32_t child[8];  ///< a block, or kLeaf | number of elements

  bool isLeaf(unsigned slot) const { return child[slot] & kLeaf; }
  std::uint32_t count(unsigned slot) const { return child[slot] & ~kLeaf; }
  bool isEmpty(unsigned slot) const { return child[slot] == kLeaf; }
  FloatBox box(unsigned slot) const {
    return {{lower[0][slot], lower[1][slot], lower[2][slot], 0},
            {upper[0][slot], upper[1][slot], upper[2][slot], 0}};
  }
  void setBox(unsigned slot, const FloatBox& box) {
    for (int k = 0; k < 3; ++k) {
      lower[k][slot] = box.lower[k];
      upper[k][slot] = box.upper[k];
    }
  }
};
static_assert(sizeof(OctreeBlock) == 256,
              "four cache lines: two of bounds on each side, one of links");

/// Blocks, numbered from 0. Grows by at least kGrowth blocks and by half of what it has; blocks
/// that a smaller tree no longer needs stay in it, free.
///
/// While a tree is built, before it has blocks, their memory is lent to other elements.
class BlockPool {
 public:
  static constexpr std::size_t kGrowth = 64;

  /// So many elements in place of all blocks. Their values are indeterminate.
  template <class T>
  std::span<T> lend(std::size_t count) {
    m_blocks = {};
    reserve((count * sizeof(T) + sizeof(OctreeBlock) - 1) / sizeof(OctreeBlock));
    return m_memory.start<T>(count);
  }
  /// So many blocks in place of what was there. Their values are indeterminate.
  void start(std::size_t blocks) {
    m_blocks = {};
    reserve(blocks);
    m_blocks = m_memory.start<OctreeBlock>(blocks);
  }
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

  Arena m_memory;
  std::span<OctreeBlock> m_blocks;
};

/// A node: block * 8 + slot. The root is node 0, alone in block 0.
using OctreeNode = std::uint32_t;

/// What a build makes: the nodes over an order of elements.
struct OctreeNodes {
  Cube rootCube{};
  BlockPool pool;
  Buffer<OctreeNode> parents;  ///< of each block
  /// Leaves and the own elements of other nodes: group g is elements [groups[g], groups[g + 1])
  /// of the order.
  Buffer<std::uint32_t> groups;
  Buffer<OctreeNode> groupNodes;  ///< the node of each group
  /// Part i of the build made blocks [partBlocks[i], partBlocks[i + 1]). Part 0 is the top.
  Buffer<std::uint32_t> partBlocks;
};

class OctreeBuilder;

/// The loose octree of one geometry: sees boxes and positions in an order, no meshes.
///
/// An octree is in one of three stages:
///
///   empty      after reset(), and, with a size of 0, after a reset() or build() that failed.
///   laid out   after build(), and after a fit() that failed. Nodes hold their elements, in a
///              new order(); their boxes are not known yet.
///   built      after fit(). Searches work in this stage only, and throw in the others.
///
/// A frame that rebuilds the tree goes through all: the caller writes boxes() in the order() of the
/// last frame; build(); the caller writes boxes() in the new order(), and groupBoxes(); fit(). A
/// frame that refits it begins after build().
///
/// An exception from any member leaves an octree that can be reset() and built as a new one.
class Octree {
 public:
  Octree();
  Octree(const Octree&) = delete;
  Octree& operator=(const Octree&) = delete;
  ~Octree();

  /// Forgets the tree; `order()` is then 0, 1, ..., size - 1.
  void reset(std::size_t size);

  std::size_t size() const { return m_order.size(); }
  std::span<const std::uint32_t> order() const {
    return m_order;
  }  ///< element ids as the nodes hold them
  BoxArrays& boxes() { return m_boxes; }
  const BoxArrays& boxes() const { return m_boxes; }
  std::span<const std::uint32_t> groups() const { return m_nodes.groups; }  ///< see OctreeNodes
  FloatBox* groupBoxes() { return m_groupBoxes.data(); }

  /// Lays out the nodes. Afterwards order() is new, and boxes() are still in the old one.
  /// `bounds`: of all boxes; `bulk`: the extent of most of them, about 0. `keys`: scratch, as many
  /// elements as there are elements.
  void build(const FloatBox& bounds, double bulk, const OctreeSettings&,
             std::span<std::uint64_t> keys, const Threads&);
  /// Carries the groups' boxes to the root.
  void fit(const Threads&);
  void measureLooseness();  ///< of what was fitted

  bool isBuilt() const { return m_stage == Stage::Built; }
  /// Throws unless isBuilt(): where every search starts.
  void requireBuilt() const {
    if (!isBuilt()) throwNotBuilt();
  }

  /// Sum of the leaves' half areas over that of some of their elements: how loose the fitted
  /// boxes are. Grows as a refitted tree degrades; unchanged by motion and scaling of the whole.
  double looseness() const { return m_looseness; }
  /// Whether the leaves have not become much larger, in relation to their elements, than they
  /// were at their tightest since the tree was built; else it should be built again.
  bool isTight() const { return m_looseness <= kMostLoosening * m_leastLooseness; }

  const OctreeBlock* blocks() const { return m_nodes.pool.data(); }
  const BlockPool& pool() const { return m_nodes.pool; }
  const Cube& rootCube() const { return m_nodes.rootCube; }
  std::size_t bytes() const;
  FloatBox box(OctreeNode node) const { return blocks()[node >> 3].box(node & 7); }
  bool isEmpty(OctreeNode node) const { return blocks()[node >> 3].isEmpty(node & 7); }
  /// The first of eight children, one after the other; 0 of a leaf, as the root is nobody's child.
  OctreeNode firstChild(OctreeNode node) const {
    const OctreeBlock& block = blocks()[node >> 3];
    return block.isLeaf(node & 7) ? 0 : block.child[node & 7] * 8;
  }
  /// The node whose children block `block` holds; of block 0, itself.
  OctreeNode parent(std::size_t block) const { return m_nodes.parents[block]; }

  /// Elements that a node holds itself.
  std::pair<std::uint32_t, std::uint32_t> ownRange(OctreeNode node) const {
    const OctreeBlock& block = m_nodes.pool[node >> 3];
    const unsigned slot = node & 7;
    const std::uint32_t begin = block.begin[slot];
    return {begin, block.isLeaf(slot) ? begin + block.count(slot)
                                      : m_nodes.pool[block.child[slot]].begin[0]};
  }

 private:
  static constexpr double kMostLoosening = 1.5;
  enum class Stage { Empty, LaidOut, Built };
  [[noreturn]] static void throwNotBuilt();

  Stage m_stage = Stage::Empty;
  Buffer<std::uint32_t> m_order;
  BoxArrays m_boxes;
  OctreeNodes m_nodes;
  std::unique_ptr<OctreeBuilder> m_builder;  ///< with its scratch, from the first build on
  Buffer<FloatBox> m_groupBoxes;
  Buffer<double> m_groupAreas;  ///< sums of a chunk of groups each
  double m_looseness = 0, m_leastLooseness = 0;
  bool m_builtNow = false;  ///< no looseness was measured since
};

}  // namespace palpate
