#pragma once

#include "Octree/Layout.h"
#include "Octree/Octree.h"

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Builds the nodes of an octree from the boxes of its elements. Owns the scratch of a build, so
/// that the next build allocates nothing.
///
/// Phases, as build() runs them:
///
///   layOutTop       computes keys, sorts them and lays out nodes, from the root down to subtrees
///                   that are small enough for a task. A range of keys is sorted by a few digits,
///                   then the nodes that these digits distinguish are laid out. Parts that are
///                   too full for a leaf are sorted further.
///   layOutTasks     the same for each task, in parallel.
///   orderElements   brings the elements' ids into the order of the sorted keys.
///   assemble        joins the nodes of all tasks to one tree.
///
/// Octree::fit() follows when the boxes are known in the new order. Docs/Algorithms/LooseOctree.md
/// follows one small build by hand.
///
/// Memory. While a tree is built, keys need 16 bytes for each element: 8 for themselves, and 8 for
/// a copy while they are sorted. The caller lends the memory of the keys. The copies use the pool's
/// memory, which has no blocks before assemble().
class OctreeBuilder {
 public:
  /// Makes the nodes and brings `order` into their order. `boxes` are in the order given. After an
  /// exception, `order` and `nodes` must not be used.
  void build(const BoxArrays& boxes, const FloatBox& bounds, double bulk, const OctreeSettings&,
             std::span<std::uint64_t> keys, Buffer<std::uint32_t>& order, OctreeNodes& nodes,
             const Threads&);
  std::size_t bytes() const;

 private:
  void layOutTop(const KeySort&, std::uint32_t size, const Cube& root, const OctreeSettings&,
                 const Threads&);
  void layOutTasks(const KeySort&, const OctreeSettings&, const Threads&);
  void orderElements(std::span<const std::uint64_t> keys, Buffer<std::uint32_t>& order, BlockPool&,
                     const Threads&) const;
  void assemble(std::uint32_t size, OctreeNodes&, const Threads&);
  void placeGroups(std::uint32_t size, OctreeNodes&);
  void writeGroup(std::size_t entry, OctreeNodes&) const;
  void writeBlocks(std::size_t part, OctreeNodes&) const;

  const Layout& top() const { return m_layouts[0]; }
  std::size_t tasks() const { return m_layouts[0].tasks.size(); }

  std::vector<Layout> m_layouts = std::vector<Layout>(1);  ///< the top, then one for each task
  std::vector<Buffer<std::uint32_t>> m_ends;               ///< PartEnds, for each of the threads
  Buffer<std::uint32_t> m_sharedCounts;
  Buffer<std::uint32_t> m_groupPlaces;  ///< for each entry of the top's groups
};

}  // namespace palpate
