#include "Octree/PointQueries.h"

#include <algorithm>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/PointQueries.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

constexpr std::size_t kSide = 16;  ///< primitives looked at together

/// Bits of those of sixteen primitives from `first` on, or eight siblings, at most `size`, of which
/// `take(d, boxes, lane)` is true, as the map places them.
template <class D, class Boxes, class Take>
HWY_ATTR HWY_INLINE std::uint32_t takeBoxes(D d, const Boxes& from, std::size_t first,
                                            std::size_t size, const BoxMap& map, Take&& take) {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
    const auto boxes = BoxLanes<D>::load(from, first + i).turned(map);
    bits |= bitsOf(d, hn::And(hn::FirstN(d, size - i), take(d, boxes, i))) << i;
  }
  return bits;
}

/// At least as far as a box may seem that is no further than this: a squared distance is off by
/// less than 2^-20 of itself, and by what outward rounding has to spare where its squares are
/// denormal.
float boundOf(double distanceSquared) {
  return OutwardRounding::up(static_cast<float>(distanceSquared) * (1.0f + 0x1p-19f));
}

HWY_ATTR void findOverlappingKernel(const Octree& octree, const BoxMap& map, const FloatBox& box,
                                    PointQueryStack& stack) {
  const auto overlapping = [&](auto, const auto& boxes, std::size_t)
                               HWY_ATTR { return boxes.overlapping(box); };
  const OctreeBlock* blocks = octree.blocks();
  stack.found.clear();
  stack.entries.clear();
  if (map(blocks[0].box(0)).overlaps(box)) stack.entries.push_back({0, 0});
  while (!stack.entries.empty()) {
    const OctreeNode node = stack.entries.back().node;
    stack.entries.pop_back();
    const auto [begin, end] = octree.ownRange(node);
    for (std::uint32_t i = begin; i < end; i += kSide) {
      const std::size_t size = std::min<std::size_t>(kSide, end - i);
      std::uint32_t bits = takeBoxes(LeafTag(), octree.boxes(), i, size, map, overlapping);
      for (; bits; bits &= bits - 1)
        stack.found.push_back(i + static_cast<std::uint32_t>(std::countr_zero(bits)));
    }
    const OctreeBlock& block = blocks[node >> 3];
    if (block.isLeaf(node & 7)) continue;
    const std::uint32_t child = block.child[node & 7];
    std::uint32_t bits = takeBoxes(NodeTag(), blocks[child], 0, 8, map, overlapping);
    for (; bits; bits &= bits - 1)
      stack.entries.push_back({0, child * 8 + static_cast<std::uint32_t>(std::countr_zero(bits))});
  }
}

HWY_ATTR void tryNearestKernel(const Octree& octree, const BoxMap& map, const FloatBox& point,
                               double distanceSquared, PointQueryStack& stack, void* context,
                               TryPrimitive tryPrimitive) {
  const OctreeBlock* blocks = octree.blocks();
  using Entry = PointQueryStack::Entry;
  float bound = boundOf(distanceSquared);
  alignas(64) float squares[kSide];
  const auto within = [&](auto d, const auto& boxes, std::size_t i) HWY_ATTR {
    const auto distances = boxes.distanceFrom(point);
    hn::Store(distances, d, squares + i);
    return hn::Le(distances, hn::Set(d, bound));
  };
  stack.entries.assign(1, {0, 0});
  while (!stack.entries.empty()) {
    const Entry entry = stack.entries.back();
    stack.entries.pop_back();
    if (entry.distanceSquared > bound) continue;
    const auto [begin, end] = octree.ownRange(entry.node);
    for (std::uint32_t i = begin; i < end; i += kSide) {
      const std::size_t size = std::min<std::size_t>(kSide, end - i);
      std::uint32_t bits = takeBoxes(LeafTag(), octree.boxes(), i, size, map, within);
      for (; bits; bits &= bits - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(bits));
        if (squares[lane] <= bound) bound = boundOf(tryPrimitive(context, i + lane));
      }
    }
    const OctreeBlock& block = blocks[entry.node >> 3];
    if (block.isLeaf(entry.node & 7)) continue;
    const std::uint32_t child = block.child[entry.node & 7];
    const std::size_t first = stack.entries.size();
    std::uint32_t bits = takeBoxes(NodeTag(), blocks[child], 0, 8, map, within);
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<std::uint32_t>(std::countr_zero(bits));
      const Entry next{squares[slot], child * 8 + slot};
      // Nearest last, to be taken first.
      std::size_t place = stack.entries.size();
      stack.entries.push_back(next);
      for (; place > first && stack.entries[place - 1].distanceSquared < next.distanceSquared;
           --place)
        stack.entries[place] = stack.entries[place - 1];
      stack.entries[place] = next;
    }
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(findOverlappingKernel);
HWY_EXPORT(tryNearestKernel);

void findOverlapping(const Octree& octree, const BoxMap& map, const FloatBox& box,
                     PointQueryStack& stack) {
  octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(findOverlappingKernel)(octree, map, box, stack);
}

void tryNearest(const Octree& octree, const BoxMap& map, const FloatBox& point,
                double distanceSquared, PointQueryStack& stack, void* context,
                TryPrimitive tryPrimitive) {
  octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(tryNearestKernel)
  (octree, map, point, distanceSquared, stack, context, tryPrimitive);
}

}  // namespace palpate
#endif
