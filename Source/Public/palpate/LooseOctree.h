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

/// A view of the octrees of all geometries with elements (Docs/Algorithms/LooseOctree.md).
/// Units    L, in the body's frame if setTransform() placed the geometry.
/// Valid    as long as its OctreeBasedCD. Updates change it; after one that an exception ended, the
///          geometries concerned have no nodes.
/// Threads  as const functions of OctreeBasedCD, but not while queries() updates octrees.
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

  /// Nodes with elements in their subtrees, parents before children. Linear in the nodes.
  std::vector<Node> nodes(GeometryId) const;
  std::vector<GeometryId> geometries() const;  ///< those with nodes, ascending
  Update lastUpdate(GeometryId) const;         ///< what the last update did to its tree
  OctreeStatistics statistics() const;

  /// A sentence for each violated invariant (Docs/Algorithms/LooseOctree.md), in linear time.
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
