// For files with SIMD code, after Core/Simd.h: included once for each instruction set.
#if defined(PALPATE_OCTREE_BOX_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef PALPATE_OCTREE_BOX_LANES
#undef PALPATE_OCTREE_BOX_LANES
#else
#define PALPATE_OCTREE_BOX_LANES
#endif

#include "Math/BoxRounding.h"
#include "Octree/BoxMap.h"
#include "Octree/Dops.h"
#include "Octree/Octree.h"

#include <array>
#include <limits>
#include <type_traits>

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using NodeTag = hn::CappedTag<float, kChildren>;  ///< eight siblings
using LeafTag = hn::CappedTag<float, 16>;         ///< elements of a leaf
using BoxTag = hn::CappedTag<float, 1>;

/// Bounds along K directions: a box, or a k-DOP.
template <int K>
struct DopBounds {
  std::array<float, K> lower, upper;
};
template <int K>
using BoundsOf = std::conditional_t<K == 3, FloatBox, DopBounds<K>>;

/// As many boxes as D has lanes, one box in each lane. Or k-DOPs, of K directions.
template <class D, int K = 3>
struct BoxLanes {
  using Bounds = BoundsOf<K>;

  hn::Vec<D> lower[K], upper[K];

  /// Loads boxes from the i-th on. Boxes: OctreeBlock, BoxArrays, or the same for k-DOPs.
  template <class Boxes>
  HWY_ATTR HWY_INLINE static BoxLanes load(const Boxes& boxes, std::size_t i) {
    const D d;
    BoxLanes lanes;
    for (int k = 0; k < K; ++k) {
      lanes.lower[k] = hn::LoadU(d, &boxes.lower[k][i]);
      lanes.upper[k] = hn::LoadU(d, &boxes.upper[k][i]);
    }
    return lanes;
  }
  /// The same box in each lane.
  HWY_ATTR HWY_INLINE static BoxLanes of(const Bounds& box) {
    const D d;
    BoxLanes lanes;
    for (int k = 0; k < K; ++k) {
      lanes.lower[k] = hn::Set(d, box.lower[k]);
      lanes.upper[k] = hn::Set(d, box.upper[k]);
    }
    return lanes;
  }
  HWY_ATTR HWY_INLINE Bounds first() const {
    Bounds box;
    for (int k = 0; k < K; ++k) {
      box.lower[k] = hn::GetLane(lower[k]);
      box.upper[k] = hn::GetLane(upper[k]);
    }
    return box;
  }
  HWY_ATTR HWY_INLINE BoxLanes shifted(const std::array<float, 4>& down,
                                       const std::array<float, 4>& up) const {
    const D d;
    BoxLanes lanes;
    for (int k = 0; k < K; ++k) {
      lanes.lower[k] = roundedDown(lower[k] + hn::Set(d, down[k]));
      lanes.upper[k] = roundedUp(upper[k] + hn::Set(d, up[k]));
    }
    return lanes;
  }
  /// Bounds that were clamped to float's range may be anywhere beyond it.
  HWY_ATTR HWY_INLINE BoxLanes unclamped() const {
    const D d;
    const auto most = hn::Set(d, kLargestFloat), least = hn::Neg(most),
               infinity = hn::Set(d, std::numeric_limits<float>::infinity());
    BoxLanes lanes;
    for (int k = 0; k < 3; ++k) {
      lanes.lower[k] = hn::IfThenElse(hn::Le(lower[k], least), hn::Neg(infinity), lower[k]);
      lanes.upper[k] = hn::IfThenElse(hn::Ge(upper[k], most), infinity, upper[k]);
    }
    return lanes;
  }
  /// Maps the boxes by one end of a BoxMap, whose comment derives the rounding, or of a DopMap.
  template <class End>
  HWY_ATTR HWY_INLINE BoxLanes mappedBy(const End& end) const {
    const D d;
    const auto middle = hn::Set(d, 0.5f), zero = hn::Zero(d);
    hn::Vec<D> c[K], h[K], farthest = zero;
    for (int j = 0; j < K; ++j) {
      c[j] = (lower[j] + upper[j]) * middle;
      h[j] = (upper[j] - lower[j]) * middle;
      if (K == 3) farthest = hn::Max(farthest, hn::Max(hn::Neg(lower[j]), upper[j]));
    }
    BoxLanes lanes;
    for (int k = 0; k < K; ++k) {
      hn::Vec<D> centre = zero, half = zero, size = zero;
      for (int i = 0; i < 3; ++i) {
        int j = i;
        if constexpr (K > 3) j = end.from[k][i];
        const auto m = hn::Set(d, end.matrix[k][i]);
        centre = centre + m * c[j];
        half = half + hn::Abs(m) * h[j];
        size = size + hn::Abs(m) * (hn::Abs(c[j]) + h[j]);
      }
      half = half + (size * hn::Set(d, BoxMap::kRelative) + hn::Set(d, OutwardRounding::kAbsolute));
      if (K == 3)
        half = hn::IfThenElse(hn::Ge(farthest, hn::Set(d, kLargestFloat)),
                              hn::Set(d, std::numeric_limits<float>::infinity()), half);
      lanes.lower[k] = roundedDown(centre - half + hn::Set(d, end.shiftLower[k]));
      lanes.upper[k] = roundedUp(centre + half + hn::Set(d, end.shiftUpper[k]));
    }
    return lanes;
  }
  template <class Map>
  HWY_ATTR HWY_INLINE BoxLanes mapped(const Map& map) const {
    if (map.count == 0) return *this;
    BoxLanes lanes = mappedBy(map.ends[0]);
    if (map.count == 1) return lanes;
    const BoxLanes other = mappedBy(map.ends[1]);
    for (int k = 0; k < K; ++k) {
      lanes.lower[k] = hn::Min(lanes.lower[k], other.lower[k]);
      lanes.upper[k] = hn::Max(lanes.upper[k], other.upper[k]);
    }
    return lanes;
  }

  HWY_ATTR HWY_INLINE hn::Mask<D> overlapping(const Bounds& box) const {
    const D d;
    auto mask = hn::Le(lower[0], hn::Set(d, box.upper[0]));
    mask = hn::And(mask, hn::Ge(upper[0], hn::Set(d, box.lower[0])));
    for (int k = 1; k < K; ++k) {
      mask = hn::And(mask, hn::Le(lower[k], hn::Set(d, box.upper[k])));
      mask = hn::And(mask, hn::Ge(upper[k], hn::Set(d, box.lower[k])));
    }
    return mask;
  }
  /// Squared distance; infinity for empty boxes.
  HWY_ATTR HWY_INLINE hn::Vec<D> distanceFrom(const FloatBox& box) const {
    const D d;
    auto sum = hn::Zero(d);
    for (int k = 0; k < 3; ++k) {
      const auto outside =
          hn::Max(hn::Max(lower[k] - hn::Set(d, box.upper[k]), hn::Set(d, box.lower[k]) - upper[k]),
                  hn::Zero(d));
      sum += outside * outside;
    }
    return hn::IfThenElse(hn::Le(lower[0], upper[0]), sum,
                          hn::Set(d, std::numeric_limits<float>::infinity()));
  }
};

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
