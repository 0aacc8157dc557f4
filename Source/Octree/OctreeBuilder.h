#pragma once

#include "Octree/Layout.h"
#include "Octree/Octree.h"

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Builds the nodes of an octree from the boxes of its elements. Owns the scratch that a build
/// needs, so that the next build allocates nothing.
///
/// Phases, as build() runs them:
///
///   layOutTop         computes keys, sorts them and lays out nodes, from the root down to subtrees
///                     that are small enough for a task. Keys, sort and layout take turns: a range
///                     of keys is sorted by a few digits, the nodes that these digits tell apart
///                     are laid out, and parts that are too full for leaves are sorted further.
///   layOutTasks       the same for each task, side by side.
///   orderElements   brings the elements' ids into the order of the sorted keys.
///   assemble          joins the nodes of all tasks to one tree.
///
/// Octree::fit() follows, when the boxes are known in the new order.
/// Docs/Algorithms/LooseOctree.md follows one small build by hand.
///
/// Memory. Keys need 16 bytes an element while a tree is built: for themselves and for a copy
/// while they are sorted. The caller lends the former. The latter lie in the pool's memory, which
/// has no blocks until assemble().
class OctreeBuilder {
 public:
  /// Makes nodes and brings `order` into theirs. `boxes` are in the order given. After an exception
  /// `order` and `nodes` are of no use.
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
  std::vector<Buffer<std::uint32_t>> m_ends;  ///< of sorted ranges, for each of the threads
  Buffer<std::uint32_t> m_sharedCounts;
  Buffer<std::uint32_t> m_groupPlaces;  ///< of each entry of the top's groups
};

}  // namespace palpate
