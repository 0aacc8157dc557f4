#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Geometry>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
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

/// A view of the octrees of the last update, for diagnostics and display. There is one octree for
/// each geometry that has elements; analytical shapes have none.
///
/// The tree's root follows its geometry, so that a body that moves as a whole keeps its cells. If
/// setTransform() placed the geometry, the tree and all its boxes are in the body's frame. See
/// Docs/Algorithms/LooseOctree.md.
///
/// Units    boxes are in L.
/// Valid    as long as the OctreeBasedCD to which it belongs. Each update changes what it shows;
///          node ids are valid until the next update. It cannot be copied. If an exception ended an
///          update, the geometries concerned have no nodes until the next update.
/// Threads  as const functions of OctreeBasedCD, but not while queries() updates octrees.
class PALPATE_EXPORT LooseOctree {
 public:
  enum class NodeId : std::uint32_t {};
  enum class Update { Rebuilt, Refitted, Unchanged };

  /// A node, copied. Its element span is valid until the next update.
  struct Node {
    GeometryId geometry;
    int depth;                        ///< root: 0
    Eigen::AlignedBox3d bounds;       ///< the cell's cube
    Eigen::AlignedBox3d looseBounds;  ///< the cube doubled about its centre
    /// encloses all elements of the subtree; float, rounded outward
    Eigen::AlignedBox3d fittedBox;
    /// set of geometries in the subtree: bit (geometry id mod 64) of each
    std::uint64_t geometries;
    std::optional<NodeId> parent;
    /// by octant (bit 0: x, bit 1: y, bit 2: z); empty children are absent
    std::array<std::optional<NodeId>, 8> children;
    std::span<const std::uint32_t> elements;  ///< ids of the elements in this node itself
    bool leaf;
  };

  /// The nodes in use of one geometry, or of all geometries by geometry id. A parent comes before
  /// its children. Empty for a geometry without nodes, or an unknown one.
  std::vector<NodeId> nodes(GeometryId) const;
  std::vector<NodeId> nodes() const;
  std::optional<NodeId> root(GeometryId) const;  ///< none if the geometry has no nodes
  Node node(NodeId) const;              ///< throws IndexOutOfRange if the node does not exist
  Update lastUpdate(GeometryId) const;  ///< what the last update did to its tree
  OctreeStatistics statistics() const;

  /// Checks every invariant of the trees. Each element is in exactly one node and within the fitted
  /// boxes above it. Fitted boxes are tight. Links agree in both directions. Free and used blocks
  /// add up to those allocated. After a rebuild, each element is in the cell of its centre and
  /// inside that cell's loose bounds, up to 2^-22 of the root's edge.
  ///
  /// Returns  one sentence for each violation.
  /// Cost     linear in the elements.
  std::vector<std::string> validate() const;

  /// For OctreeBasedCD only.
  struct State;
  explicit LooseOctree(std::shared_ptr<const State> state) : m_state(std::move(state)) {}
  LooseOctree(const LooseOctree&) = delete;
  LooseOctree& operator=(const LooseOctree&) = delete;

 private:
  std::shared_ptr<const State> m_state;
};
PALPATE_EXPORT const char* toString(LooseOctree::Update) noexcept;  ///< its name, or "unknown"

}  // namespace palpate
