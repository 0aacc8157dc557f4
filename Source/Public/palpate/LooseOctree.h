#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Geometry>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace palpate {

/// Sizes of all octrees of an OctreeBasedCD together.
struct OctreeStatistics {
  std::size_t nodesInUse = 0;      ///< nodes with an element in their subtree
  std::size_t nodesAllocated = 0;  ///< eight per block of the pools, used or free
  std::size_t blocksInUse = 0, blocksFree = 0, blocksAllocated = 0;
  int deepestLevel = 0;  ///< root: 0
  std::size_t elements = 0;
  std::size_t maxElementsInNode = 0;
  std::vector<std::size_t> nodesByDepth, elementsByDepth;  ///< one entry per level, from the root
  std::size_t bytes = 0;  ///< memory of boxes, keys, nodes and scratch
};

/// A view of the octrees of the last update, for diagnostics and display. Each geometry with
/// elements has one; analytical shapes have none.
/// Units    L. If setTransform() placed the geometry, boxes are in the body's frame.
/// Valid    as long as the OctreeBasedCD to which it belongs. Each update changes what it shows. If
///          an exception ended an update, the geometries concerned have no nodes until the next
///          one.
/// Threads  as const functions of OctreeBasedCD, but not while queries() updates octrees.
/// Source   Docs/Algorithms/LooseOctree.md.
class PALPATE_EXPORT LooseOctree {
 public:
  enum class Update { Rebuilt, Refitted, Unchanged };

  struct Node {
    GeometryId geometry;
    int depth;                        ///< root: 0
    Eigen::AlignedBox3d bounds;       ///< the cell's cube
    Eigen::AlignedBox3d looseBounds;  ///< the cube doubled about its centre
    Eigen::AlignedBox3d fittedBox;    ///< encloses the subtree's elements; floats, rounded outward
    std::uint32_t parent;             ///< its place in the list; kNoElement for the root
    std::span<const std::uint32_t> elements;  ///< in this node itself; valid until the next update
  };

  /// The nodes of one geometry that have elements in their subtree. A parent comes before its
  /// children. Empty for a geometry without nodes, or an unknown one.
  /// Cost     linear in the nodes.
  std::vector<Node> nodes(GeometryId) const;
  std::vector<GeometryId> geometries() const;  ///< those with nodes, ascending
  Update lastUpdate(GeometryId) const;         ///< what the last update did to its tree
  OctreeStatistics statistics() const;

  /// Checks every invariant of the trees. Each element is in exactly one node and within the fitted
  /// boxes above it. Fitted boxes are tight. Links agree in both directions. Free and used blocks
  /// add up to those allocated. After a rebuild, each element is in the cell of its centre and
  /// inside that cell's loose bounds, up to 2^-22 of the root's edge.
  /// Returns  one sentence for each violation.
  /// Cost     linear in the elements.
  std::vector<std::string> validate() const;

  struct State;  ///< not part of the interface
  LooseOctree(const LooseOctree&) = delete;
  LooseOctree& operator=(const LooseOctree&) = delete;

 private:
  explicit LooseOctree(const State& state) : m_state(state) {}

  const State& m_state;
};
PALPATE_EXPORT const char* toString(LooseOctree::Update) noexcept;  ///< its name, or "unknown"

}  // namespace palpate
