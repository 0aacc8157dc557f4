#pragma once

#include "Bodies/Body.h"
#include "Octree/BoxMap.h"
#include "Octree/Octree.h"
#include "Octree/Walk.h"
#include "Mesh/FloatPositions.h"
#include "Mesh/TriangleMesh.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace palpate {

/// One of two geometries, of which the nearest pair of elements is searched.
struct PairSide {
  explicit PairSide(const Body& body, const BoxMap& toCommon = {})
      : octree(body.tree.octree()),
        floats(body.tree.floats().now()),
        ordered(body.tree.ordered().data()),
        map(toCommon) {}

  const Octree& octree;
  const FloatPoint* floats;  ///< of the vertices, in the octree's frame
  const Triangle* ordered;   ///< elements in the octree's order
  BoxMap map;                ///< to common floats
};
/// Pairs of elements are skipped if their boxes are further apart than `distance`, or if their
/// lowest heights along one direction for each geometry have a sum above `heights`.
struct PairBound {
  float distance = std::numeric_limits<float>::infinity();  ///< in the common floats
  float heights = std::numeric_limits<float>::infinity();
  std::array<float, 3> alongA{}, alongB{};  ///< in the floats of each octree
};
/// Elements of both octrees whose boxes are near each other. Places are those of the orders.
struct NearElements {
  static constexpr std::size_t kSide = 16;
  std::uint32_t placeA, placeB;
  /// Bit j of near[i]: the elements at placeA + i and placeB + j are near each other.
  std::array<std::uint32_t, kSide> near;
};
/// Scratch of a search. It is too large for a small stack.
struct PairScratch {
  /// Heights of elements, in blocks of the octree's order. Block i is in slot i % kSlots.
  struct Heights {
    static constexpr std::uint32_t kBlock = 64, kSlots = 64, kNone = 0xffffffff;

    std::array<std::uint32_t, kSlots> blocks;
    float heights[kSlots][kBlock + BoxArrays::kPadding];
  };
  /// A node, and the end of its subtree's range of elements.
  struct Subtree {
    OctreeNode node;
    std::uint32_t end;
  };
  struct Subtrees {
    Subtree a, b;
  };

  Heights a, b;
  /// Squared distances of boxes. On each level of each octree, all siblings and the own elements of
  /// their parent wait.
  NearestStack<float, Subtrees, 2 * (kChildren * kMaxLevels + 1)> waiting;
};

/// Tests elements. Returns the bound for those that follow.
using TestElements = PairBound (*)(void* context, const NearElements&);

/// Visits pairs of elements, nearest pairs of nodes first. Of two nodes the larger one is replaced
/// by its children.
void searchPairs(const PairSide& a, const PairSide& b, const PairBound&, PairScratch&,
                 void* context, TestElements);

/// searchPairs() with f(elements) in place of the function pointer.
template <class F>
void forNearElements(const PairSide& a, const PairSide& b, const PairBound& bound,
                     PairScratch& scratch, F&& f) {
  const auto call = [](void* context, const NearElements& elements) {
    return (*static_cast<std::remove_reference_t<F>*>(context))(elements);
  };
  searchPairs(a, b, bound, scratch, &f, call);
}

}  // namespace palpate
