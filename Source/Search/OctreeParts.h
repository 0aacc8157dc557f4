#pragma once

#include "Bodies/Body.h"
#include "Octree/Traversal.h"
#include "Mesh/PieceMotion.h"
#include "Core/CountedVector.h"

#include <array>
#include <cstdint>

namespace palpate {

/// The nodes of an octree that hold all of its elements, each once.
struct OctreeParts {
  CountedVector<OctreeNode> nodes;  ///< as NodePair has them
  /// Part i has groups [groups[i], groups[i + 1]) of the octree.
  CountedVector<std::uint32_t> groups;
  IndexLists pieces;                  ///< of PieceMotion, for each node
  CountedVector<MotionRange> moved;   ///< of each node, since the last detection
  std::uint64_t layout = 0;           ///< Octree::layout() of the nodes
  CountedVector<std::uint8_t> isCut;  ///< those that cut() changed
  void make(const Body&);
  bool areOf(const Body& body) const { return layout == body.tree.octree().layout(); }
  /// Whether a cut made the present octree of the parts' one.
  bool canCut(const Body&) const;
  void cut(const Body&);
  MotionRange addMotion(const PieceMotion&);
};

using PartPair = std::array<std::uint32_t, 2>;

/// Ascending pairs of parts whose boxes overlap at the distance of the trees. cut: only those that
/// a cut changed, with all others.
CountedVector<PartPair> nearParts(const OctreeParts& a, const OctreeParts& b, const TreePair&,
                                  bool cut);

}  // namespace palpate
