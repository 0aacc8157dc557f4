#pragma once

#include "Bodies/OctreeSlices.h"
#include "Bodies/OrderedElements.h"
#include "Octree/Octree.h"
#include "Mesh/FloatPositions.h"
#include "Mesh/TriangleMesh.h"
#include "Core/CountedVector.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Cuts since an octree's last update, and how the octree follows them: few elements leave the
/// nodes or join them. It knows the group of each element.
class ElementCuts {
 public:
  /// Call before add(), which then does not throw. Nothing to do where isLarge().
  void reserve(std::size_t removed) { reserveAmortized(m_removed, m_removed.size() + removed); }
  void add(std::span<const std::uint32_t> removed) noexcept {
    m_removed.insert(m_removed.end(), removed.begin(), removed.end());
  }
  /// Whether so many more removed or added elements are too many to follow.
  bool isLarge(std::size_t more, const OrderedElements& ordered) const {
    return isLargeCut(m_removed.size() + more, ordered.size());
  }
  /// Changes the octree and what follows it. Returns false, so that the tree must be built anew,
  /// if elements that left or joined are many, or if a group would become too full. keepsBoxes: as
  /// of Octree::replace(); slices of groups that changed are then due.
  /// Cost     see Octree::replace().
  bool apply(const TriangleMesh&, const FloatFrame&, const OctreeSettings&, bool keepsBoxes,
             Octree&, OrderedElements&, OctreeSlices&);
  void finish(const MeshTopology&);    ///< the octree was brought up to date
  void setBuilt() { m_replaced = 0; }  ///< the octree was built
  void releaseMemory();

  /// A cut that apply() followed: Octree::layout() before and after, and the groups, ascending,
  /// that hold elements with a vertex of those that left or joined, or held elements that left.
  struct Cut {
    std::uint64_t before = 0, after = 0;
    CountedVector<std::uint32_t> groups;
  };
  const Cut& last() const { return m_cut; }
  std::size_t bytes() const {
    return (m_groupOf.capacity() + m_removed.capacity()) * sizeof(std::uint32_t);
  }

 private:
  /// Elements that leave or join, and what they change.
  struct Changes {
    CountedVector<std::uint32_t> places;  ///< of elements that leave, in the octree's order
    CountedVector<Octree::Joining> joining;
    CountedVector<std::uint32_t> vertices;  ///< of all these elements
  };
  void findGroups(const Octree&);
  void findLeaving(const Octree&, const OrderedElements&, Changes&);
  void findJoining(const TriangleMesh&, const FloatFrame&, const Octree&, Changes&) const;
  bool joinGroups(const Octree&, std::int64_t mostInGroup, const Changes&);
  void addNeighbours(const MeshTopology&, CountedVector<std::uint32_t>& vertices);

  CountedVector<std::uint32_t> m_removed;
  std::size_t m_elements = 0;              ///< ids below it were known to the last update
  std::size_t m_replaced = 0;              ///< elements that left or joined since the last build
  CountedVector<std::uint32_t> m_groupOf;  ///< per element: its group of the octree, or none
  std::uint64_t m_groupsLayout = 0;        ///< Octree::layout() of m_groupOf
  Cut m_cut;
};

}  // namespace palpate
