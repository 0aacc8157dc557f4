#include "Queries/RayTraversal.h"

#include <algorithm>
#include <array>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/RayTraversal.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

constexpr std::size_t kSide = 16;  ///< elements tested together

/// A ray in each lane, for boxes in arrays: six for the lower and the upper bounds of each axis.
template <class D>
struct RayLanes {
  using V = hn::Vec<D>;
  V nearOrigin[3], farOrigin[3], inverse[3];
  bool isBackward[3];  ///< the ray enters at the upper bound

  HWY_ATTR HWY_INLINE explicit RayLanes(const FloatRay& ray) {
    const D d;
    for (std::size_t k = 0; k < 3; ++k) {
      isBackward[k] = ray.inverse[k] < 0;
      const float grow = isBackward[k] ? -ray.slack : ray.slack;
      nearOrigin[k] = hn::Set(d, ray.origin[k] + grow);
      farOrigin[k] = hn::Set(d, ray.origin[k] - grow);
      inverse[k] = hn::Set(d, ray.inverse[k]);
    }
  }

  /// The ray is in boxes from the i-th on for t in [enter, leave], or misses them if enter > leave.
  template <class Boxes>
  HWY_ATTR HWY_INLINE void intersect(const Boxes& boxes, std::size_t i, V& enter, V& leave) const {
    const D d;
    for (std::size_t k = 0; k < 3; ++k) {
      const float *lower = &boxes.lower[k][i], *upper = &boxes.upper[k][i];
      const V first = hn::LoadU(d, isBackward[k] ? upper : lower),
              last = hn::LoadU(d, isBackward[k] ? lower : upper);
      enter = hn::Max(enter, (first - nearOrigin[k]) * inverse[k]);
      leave = hn::Min(leave, (last - farOrigin[k]) * inverse[k]);
    }
  }
};

HWY_ATTR void traverseRayKernel(const Octree& octree, const FloatRay& ray, void* context,
                                TestElement test) {
  using D = NodeTag;
  const D d;
  const hn::RebindToUnsigned<D> du;
  constexpr std::size_t kLanes = hn::MaxLanes(d);
  // Seven siblings remain on each of at most 61 levels, and whole vectors are stored.
  constexpr std::size_t kStack = 7 * 61 + 8;
  float entries[kStack];
  std::uint32_t begins[kStack], links[kStack];  // as in OctreeBlock
  const OctreeBlock* const blocks = octree.blocks();
  entries[0] = 0;
  begins[0] = blocks[0].begin[0];
  links[0] = blocks[0].child[0];
  std::size_t count = 1;

  const RayLanes<D> nodeRay(ray);
  const RayLanes<LeafTag> leafRay(ray);
  // The i-th sibling to be stored is that in octant i ^ last: the nearest goes last, because the
  // last entry is taken first.
  std::size_t last = 7;
  for (std::size_t k = 0; k < 3; ++k) last ^= std::size_t{nodeRay.isBackward[k]} << k;
  const auto order = hn::IndicesFromVec(
      d, hn::Xor(hn::Iota(du, 0), hn::Set(du, static_cast<std::uint32_t>(last & (kLanes - 1)))));

  float tMax = ray.tMax;
  while (count > 0) {
    --count;
    if (entries[count] > tMax) continue;
    const std::uint32_t begin = begins[count], link = links[count];
    const bool isLeaf = link & OctreeBlock::kLeaf;
    const OctreeBlock& block = blocks[isLeaf ? 0 : link];
    const std::uint32_t end = isLeaf ? begin + (link & ~OctreeBlock::kLeaf) : block.begin[0];
    for (std::uint32_t first = begin; first < end; first += kSide) {
      const std::size_t size = std::min<std::size_t>(kSide, end - first);
      const LeafTag leaf;
      std::uint32_t bits = 0;
      for (std::size_t i = 0; i < size; i += hn::Lanes(leaf)) {
        auto enter = hn::Zero(leaf), leave = hn::Set(leaf, tMax);
        leafRay.intersect(octree.boxes(), first + i, enter, leave);
        bits |= bitsOf(leaf, hn::And(hn::FirstN(leaf, size - i), hn::Le(enter, leave))) << i;
      }
      for (; bits; bits &= bits - 1) {
        tMax = test(context, first + static_cast<std::uint32_t>(std::countr_zero(bits)));
        if (tMax < 0) return;
      }
    }
    if (isLeaf) continue;
    for (std::size_t i = 0; i < 8; i += kLanes) {
      const std::size_t slot = i ^ (last & ~(kLanes - 1));
      auto enter = hn::Zero(d), leave = hn::Set(d, tMax);
      nodeRay.intersect(block, slot, enter, leave);
      const auto inOrder = [&](const auto& values)
                               HWY_ATTR { return hn::TableLookupLanes(values, order); };
      enter = inOrder(enter);
      const auto entered = hn::Le(enter, inOrder(leave));
      const auto push = [&](const std::uint32_t* from, std::uint32_t* to) HWY_ATTR {
        const auto values = inOrder(hn::BitCast(d, hn::LoadU(du, from + slot)));
        hn::StoreU(hn::BitCast(du, hn::Compress(values, entered)), du, to + count);
      };
      hn::StoreU(hn::Compress(enter, entered), d, entries + count);
      push(block.begin, begins);
      push(block.child, links);
      count += hn::CountTrue(d, entered);
    }
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(traverseRayKernel);

void traverseRay(const Octree& octree, const FloatRay& ray, void* context, TestElement test) {
  octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(traverseRayKernel)(octree, ray, context, test);
}

}  // namespace palpate
#endif
