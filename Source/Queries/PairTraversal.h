#pragma once

#include "Octree/BoxMap.h"
#include "Octree/Octree.h"

#include <cstdint>
#include <type_traits>

namespace palpate {

/// A search for the pairs of elements of two octrees that are nearest to each other.
struct PairSearch {
  const Octree &a, &b;
  BoxMap mapA, mapB;  ///< to common floats
};
/// Tests the elements at two places. Returns a bound in the common floats: pairs of boxes that are
/// further apart are skipped.
using TestElements = float (*)(void* context, std::uint32_t placeA, std::uint32_t placeB);

/// Visits pairs of elements, nearest pairs of nodes first. Of two nodes the larger one is replaced
/// by its children.
void searchPairs(const PairSearch&, float bound, void* context, TestElements);

/// searchPairs() with f(placeA, placeB) in place of the function pointer.
template <class F>
void forNearPairs(const PairSearch& search, float bound, F&& f) {
  const auto call = [](void* context, std::uint32_t placeA, std::uint32_t placeB) {
    return (*static_cast<std::remove_reference_t<F>*>(context))(placeA, placeB);
  };
  searchPairs(search, bound, &f, call);
}

}  // namespace palpate
