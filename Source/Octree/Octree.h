#pragma once

#include <palpate/LooseOctree.h>
#include <palpate/Settings.h>

#include "Octree/Dops.h"
#include "Octree/OctreeNodes.h"
#include "Core/Threads.h"

#include <algorithm>
#include <memory>

namespace palpate {

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
  using Joining = OctreeNodes::Joining;
  using Move = OctreeNodes::Move;
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
  const OctreeNodes& nodes() const { return m_nodes; }
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
  FloatBox box(OctreeNode node) const { return m_nodes.box(node); }
  bool isEmpty(OctreeNode node) const { return m_nodes.isEmpty(node); }
  OctreeNode firstChild(OctreeNode node) const { return m_nodes.firstChild(node); }
  OctreeNode parent(std::size_t block) const { return m_nodes.parent(block); }
  OctreeNodes::Range ownRange(OctreeNode node) const { return m_nodes.ownRange(node); }
  OctreeNodes::Range range(OctreeNode node) const { return m_nodes.range(node); }

 private:
  static constexpr double kMaxLoosening = 1.5;
  enum class Stage { Empty, LaidOut, Built };
  [[noreturn]] static void throwNotBuilt();

  Stage m_stage = Stage::Empty;
  std::uint64_t m_layout = 0;
  Buffer<std::uint32_t> m_order;
  BoxArrays m_boxes;
  OctreeDops m_dops;
  OctreeNodes m_nodes;
  std::unique_ptr<OctreeBuilder> m_builder;  ///< keeps its scratch; null before the first build
  Buffer<FloatBox> m_groupBoxes;
  Buffer<double> m_groupAreas;  ///< one sum for each chunk of groups
  double m_looseness = 0, m_leastLooseness = 0;
  bool m_isUnmeasured = false;  ///< looseness was not measured since the build
};

}  // namespace palpate
