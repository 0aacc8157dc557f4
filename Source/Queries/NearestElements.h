#pragma once

#include "Octree/Octree.h"
#include "Mesh/FloatPositions.h"
#include "Core/Buffer.h"

#include <palpate/Types.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace palpate {

/// A search for the elements of an octree that are nearest to a point, in the octree's floats.
struct NearestSearch {
  const Octree& octree;
  const FloatPoint* floats;  ///< per vertex
  const Triangle* ordered;   ///< elements in the octree's order
  FloatPoint point;          ///< the point, rounded
  /// A bound on the error of any distance between the point and an element that comes from rounding
  /// coordinates to floats.
  float slack;
  /// An element is a candidate if its distance exceeds the bound by at most this.
  float tolerance = 0.0f;
};

/// An element that may be one of the nearest.
struct NearCandidate {
  std::uint32_t place;  ///< in the octree's order
  float lower, upper;   ///< bounds of its distance, in the octree's floats
};

/// Candidates of one search. They fit without memory from the heap.
struct NearCandidates {
  static constexpr std::size_t kCapacity = 192;
  NearCandidate at[kCapacity];
  std::size_t size = 0;
};

constexpr std::size_t kMaxCount = 32;  ///< most upper bounds that a search keeps

/// Takes candidates when their list is full and when the search ends. Returns a bound that no
/// greater distance needs to pass: elements whose lower bound exceeds it are skipped.
using TakeCandidates = float (*)(void* context, const NearCandidate* candidates, std::size_t size);

/// Visits nearest nodes first and passes every element to `take` whose lower bound of the distance
/// is at most the bound. The bound starts as `bound`.
///
/// count: number of nearest elements that are wanted. The bound is lowered to the count-th least
/// upper bound of the elements met, if count is at most kMaxCount. 0: all elements are wanted.
void searchNearest(const NearestSearch&, float bound, std::size_t count, void* context,
                   TakeCandidates take);

/// searchNearest() with f(candidates, size) in place of the function pointer.
template <class F>
void forNearCandidates(const NearestSearch& search, float bound, std::size_t count, F&& f) {
  const auto call = [](void* context, const NearCandidate* candidates, std::size_t size) {
    return (*static_cast<std::remove_reference_t<F>*>(context))(candidates, size);
  };
  searchNearest(search, bound, count, &f, call);
}

}  // namespace palpate
