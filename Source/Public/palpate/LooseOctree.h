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

struct OctreeStatistics {
  std::size_t nodesInUse = 0;      ///< that hold something in their subtree
  std::size_t nodesAllocated = 0;  ///< eight per block of the pool, used or free
  std::size_t blocksInUse = 0, blocksFree = 0, blocksAllocated = 0;
  int deepestLevel = 0;
  std::size_t elements = 0;
  std::size_t mostElementsInNode = 0;
  std::vector<std::size_t> nodesByDepth, elementsByDepth;
  std::size_t bytes = 0;  ///< boxes, keys, nodes and scratch together
};

/// The octrees of the last update: one for each geometry that has elements.
///
/// This is a view. It belongs to its OctreeBasedCD, cannot be copied, and is valid as long as its
/// owner lives. Each update changes what it shows. A geometry whose update was ended by an
/// exception has no nodes until the next update.
///
/// A tree's root follows its geometry, so a body that moves as a whole keeps its cells. The tree of
/// a geometry that setTransform() moves is in its body's frame, and so are all its boxes. See
/// Docs/Algorithms/LooseOctree.md.
class PALPATE_EXPORT LooseOctree {
 public:
  enum class NodeId : std::uint32_t {};
  enum class Update { Rebuilt, Refitted, Unchanged };

  struct Node {
    GeometryId geometry;
    int depth;                        ///< root: 0
    Eigen::AlignedBox3d bounds;       ///< the cell's cube
    Eigen::AlignedBox3d looseBounds;  ///< the cube doubled about its centre
    /// of all that the subtree holds, at most outward-rounded float wider
    Eigen::AlignedBox3d fittedBox;
    /// group set: bit (geometry id mod 64) of each geometry in the subtree
    std::uint64_t geometries;
    std::optional<NodeId> parent;
    /// by octant (bit 0: x, 1: y, 2: z); empty ones absent
    std::array<std::optional<NodeId>, 8> children;
    std::span<const std::uint32_t> elements;  ///< triangles held by this node itself
    bool leaf;
  };

  /// Nodes in use, root first, parents before children; of one geometry, or of all by geometry id.
  std::vector<NodeId> nodes(GeometryId) const;
  std::vector<NodeId> nodes() const;
  std::optional<NodeId> root(GeometryId) const;  ///< none: the geometry has no nodes
  Node node(NodeId) const;              ///< throws IndexOutOfRange for a node that does not exist
  Update lastUpdate(GeometryId) const;  ///< what the last update() did to its tree
  OctreeStatistics statistics() const;

  /// Every invariant: each element in exactly one node and within the fitted boxes above it,
  /// fitted boxes tight, links both ways, free + used = allocated; after a rebuild also: each
  /// element in the cell of its centre and inside that cell's loose bounds. Cost O(elements).
  /// Returns what does not hold, one sentence each; empty when all does.
  std::vector<std::string> validate() const;

  struct State;
  explicit LooseOctree(std::shared_ptr<const State> state) : m_state(std::move(state)) {}
  LooseOctree(const LooseOctree&) = delete;
  LooseOctree& operator=(const LooseOctree&) = delete;

 private:
  std::shared_ptr<const State> m_state;
};

}  // namespace palpate
