#pragma once

#include "Octree/BoxMap.h"
#include "Octree/Octree.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace palpate {

/// A search for the pairs of elements of two octrees that are nearest to each other.
struct PairSearch {
  const Octree &a, &b;
  BoxMap mapA, mapB;  ///< to common floats
};
/// Elements of both octrees whose boxes are near each other. Places are those of the orders.
struct NearElements {
  static constexpr std::size_t kSide = 16;
  std::uint32_t placeA, placeB;
  /// Bit j of near[i]: the elements at placeA + i and placeB + j are near each other.
  std::array<std::uint32_t, kSide> near;
};
/// Tests elements. Returns a bound in the common floats: pairs of boxes that are further apart are
/// skipped.
using TestElements = float (*)(void* context, const NearElements&);

/// Visits pairs of elements, nearest pairs of nodes first. Of two nodes the larger one is replaced
/// by its children.
void searchPairs(const PairSearch&, float bound, void* context, TestElements);

/// searchPairs() with f(elements) in place of the function pointer.
template <class F>
void forNearElements(const PairSearch& search, float bound, F&& f) {
  const auto call = [](void* context, const NearElements& elements) {
    return (*static_cast<std::remove_reference_t<F>*>(context))(elements);
  };
  searchPairs(search, bound, &f, call);
}

}  // namespace palpate
