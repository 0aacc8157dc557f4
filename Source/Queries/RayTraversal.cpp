#include "Queries/RayTraversal.h"

#include <algorithm>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/RayTraversal.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

constexpr std::size_t kSide = 16;  ///< elements tested together

/// A ray in each lane.
template <class D>
struct RayLanes {
  hn::Vec<D> origin[3], inverse[3], slack;

  HWY_ATTR HWY_INLINE explicit RayLanes(const FloatRay& ray) {
    const D d;
    for (int k = 0; k < 3; ++k) {
      origin[k] = hn::Set(d, ray.origin[static_cast<std::size_t>(k)]);
      inverse[k] = hn::Set(d, ray.inverse[static_cast<std::size_t>(k)]);
    }
    slack = hn::Set(d, ray.slack);
  }

  /// Bits of the boxes that the ray enters at tMax or before. entries: where.
  template <class Boxes>
  HWY_ATTR HWY_INLINE std::uint32_t entered(const Boxes& boxes, std::size_t first, std::size_t size,
                                            float tMax, float* entries) const {
    const D d;
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
      // The slot of an empty box has bounds in the wrong order.
      const auto used = hn::Le(hn::LoadU(d, &boxes.lower[0][first + i]),
                               hn::LoadU(d, &boxes.upper[0][first + i]));
      auto enter = hn::Zero(d), leave = hn::Set(d, tMax);
      for (int k = 0; k < 3; ++k) {
        const auto lower = hn::LoadU(d, &boxes.lower[k][first + i]) - slack,
                   upper = hn::LoadU(d, &boxes.upper[k][first + i]) + slack;
        const auto s = (lower - origin[k]) * inverse[k], t = (upper - origin[k]) * inverse[k];
        enter = hn::Max(enter, hn::Min(s, t));
        leave = hn::Min(leave, hn::Max(s, t));
      }
      hn::StoreU(enter, d, entries + i);
      bits |= bitsOf(d, hn::And(hn::And(hn::FirstN(d, size - i), used), hn::Le(enter, leave))) << i;
    }
    return bits;
  }
};

HWY_ATTR void traverseRayKernel(const Octree& octree, const FloatRay& ray, void* context,
                                TestElement test) {
  struct Entry {
    float t;
    OctreeNode node;
  };
  std::array<Entry, 512> entries;  // seven siblings remain on each of at most 61 levels
  std::size_t count = 0;
  alignas(64) float t[kSide];
  const RayLanes<NodeTag> nodeRay(ray);
  const RayLanes<LeafTag> leafRay(ray);
  float tMax = ray.tMax;
  if (RayLanes<BoxTag>(ray).entered(octree.blocks()[0], 0, 1, tMax, t))
    entries[count++] = {t[0], 0};
  while (count > 0) {
    const Entry entry = entries[--count];
    if (entry.t > tMax) continue;
    const auto [begin, end] = octree.ownRange(entry.node);
    for (std::uint32_t i = begin; i < end; i += kSide) {
      const std::size_t size = std::min<std::size_t>(kSide, end - i);
      for (std::uint32_t bits = leafRay.entered(octree.boxes(), i, size, tMax, t); bits;
           bits &= bits - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(bits));
        if (t[lane] > tMax) continue;
        tMax = test(context, i + lane);
        if (tMax < 0) return;
      }
    }
    const OctreeNode child = octree.firstChild(entry.node);
    if (child == 0) continue;
    const std::size_t first = count;
    for (std::uint32_t bits = nodeRay.entered(octree.blocks()[child >> 3], 0, 8, tMax, t); bits;
         bits &= bits - 1) {
      const auto slot = static_cast<std::uint32_t>(std::countr_zero(bits));
      // Sorted with the nearest last, because the last entry is taken first.
      std::size_t place = count++;
      for (; place > first && entries[place - 1].t < t[slot]; --place)
        entries[place] = entries[place - 1];
      entries[place] = {t[slot], child + slot};
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
