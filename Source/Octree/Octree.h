#pragma once

#include <palpate/LooseOctree.h>
#include <palpate/Settings.h>

#include "Core/Buffer.h"
#include "Core/Threads.h"
#include "Math/Box.h"
#include "Octree/Keys.h"

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Eight siblings: their fitted boxes side by side, so that one SIMD comparison prunes all eight.
///
/// Slot i is the child in octant i (bit 0: x, 1: y, 2: z). A slot in use holds primitives [begin,
/// ...) of the tree's order: as a leaf `count(i)` of them; otherwise its own primitives come first
/// and end where child block's first begins. An empty slot's box overlaps nothing.
struct alignas(64) OctreeBlock {
  static constexpr std::uint32_t kLeaf = 0x80000000u;

  float lower[3][8];
  float upper[3][8];
  std::uint32_t begin[8];
  std::uint32_t child[8];  ///< a block, or kLeaf | number of primitives

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
class BlockPool {
 public:
  static constexpr std::size_t kGrowth = 64;

  void use(std::size_t blocks) {
    if (blocks > m_blocks.size())
      m_blocks.resize(std::max(blocks, m_blocks.size() + std::max(kGrowth, m_blocks.size() / 2)));
    m_used = blocks;
  }
  std::size_t used() const { return m_used; }
  std::size_t free() const { return m_blocks.size() - m_used; }
  std::size_t allocated() const { return m_blocks.size(); }
  OctreeBlock& operator[](std::size_t i) { return m_blocks[i]; }
  const OctreeBlock& operator[](std::size_t i) const { return m_blocks[i]; }
  OctreeBlock* data() { return m_blocks.data(); }
  const OctreeBlock* data() const { return m_blocks.data(); }

 private:
  Buffer<OctreeBlock> m_blocks;
  std::size_t m_used = 0;
};

/// A node: block * 8 + slot. The root is node 0, alone in block 0.
using OctreeNode = std::uint32_t;

/// The loose octree of one geometry: sees boxes and positions in an order, no meshes.
///
/// Life of a frame, rebuilt:  boxes() of the primitives in the order() of the last frame are
/// written by the caller; build() makes keys, sorts, and lays out nodes; the caller then writes
/// boxes in the new order() with groups(), and fit() carries the groups' boxes to the root.
/// Refitted: only the last two.
class Octree {
 public:
  Octree();
  Octree(Octree&&) noexcept;
  Octree& operator=(Octree&&) noexcept;
  ~Octree();

  /// Forgets the tree; `order()` is then 0, 1, ..., size - 1.
  void reset(std::size_t size);

  std::size_t size() const { return m_order.size(); }
  std::span<const std::uint32_t> order() const {
    return m_order;
  }  ///< primitive ids as the nodes hold them
  BoxArrays& boxes() { return m_boxes; }
  const BoxArrays& boxes() const { return m_boxes; }
  /// Leaves and the own primitives of other nodes: group g is primitives [groups[g], groups[g + 1])
  /// of the order.
  std::span<const std::uint32_t> groups() const { return m_groups; }
  FloatBox* groupBoxes() { return m_groupBoxes.data(); }

  /// `bounds`: of all boxes; `bulk`: the extent of most of them, about 0. `keys`: scratch, eight
  /// bytes a primitive. Afterwards order() is new, and boxes() are still in the old one.
  void build(const FloatBox& bounds, double bulk, const OctreeSettings&, std::uint64_t* keys,
             const Threads&);
  void fit(const Threads&);
  void measureLooseness();  ///< of what was fitted

  /// Sum of the leaves' half areas over that of some of their primitives: how loose the fitted
  /// boxes are. Grows as a refitted tree degrades; unchanged by motion and scaling of the whole.
  double looseness() const { return m_looseness; }
  double leastLooseness() const { return m_leastLooseness; }  ///< since it was built

  const OctreeBlock* blocks() const { return m_pool.data(); }
  const BlockPool& pool() const { return m_pool; }
  const Cube& rootCube() const { return m_rootCube; }
  std::size_t bytes() const;
  /// The node whose children block `block` holds; of block 0, itself.
  OctreeNode parent(std::size_t block) const { return m_parents[block]; }

  /// Primitives that a node holds itself.
  std::pair<std::uint32_t, std::uint32_t> ownRange(OctreeNode node) const {
    const OctreeBlock& block = m_pool[node >> 3];
    const unsigned slot = node & 7;
    const std::uint32_t begin = block.begin[slot];
    return {begin,
            block.isLeaf(slot) ? begin + block.count(slot) : m_pool[block.child[slot]].begin[0]};
  }

 private:
  class Layout;
  struct Sorting;
  /// Keys to be sorted, where these read and do not write.
  void takeKeys(const Sorting&, std::size_t from, std::size_t to, std::uint64_t* out) const;
  /// `ends`: where each bin of the digits does. Returns how many first digits all keys have alike
  /// if these are among them: then they stay as they are, without ends; else 0.
  int sortKeys(const Sorting&, std::uint32_t* ends, const Threads*);
  /// At most kFew, by one digit. Returns where the octants begin and the range ends.
  std::array<std::uint32_t, 9> sortFewKeys(const Sorting&);
  void assemble(std::size_t tasks, const Threads&);

  Buffer<std::uint32_t> m_order;
  BoxArrays m_boxes;
  std::uint64_t* m_keys = nullptr;         ///< during a build: slots are in the old order
  std::uint64_t* m_keysScratch = nullptr;  ///< the blocks' memory, as long as they are not made
  Buffer<std::uint32_t> m_binCounts;
  Buffer<std::uint32_t> m_groups;
  Buffer<OctreeNode> m_groupNodes;  ///< the node of each group
  Buffer<FloatBox> m_groupBoxes;
  Buffer<double> m_groupAreas;  ///< sums of a chunk of groups each
  BlockPool m_pool;
  Buffer<OctreeNode> m_parents;   ///< of each block
  std::vector<Layout> m_layouts;  ///< the top's, then one for each task of the last build
  Buffer<std::uint32_t>
      m_taskBlocks;  ///< layout i made blocks [m_taskBlocks[i], m_taskBlocks[i + 1])
  Buffer<std::uint32_t> m_entryPlaces;
  Cube m_rootCube;
  double m_looseness = 0, m_leastLooseness = 0;
  bool m_builtNow = false;
};

}  // namespace palpate
