#include "Octree/PointQueries.h"

#include <algorithm>
#include <array>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/PointQueries.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

constexpr std::size_t kTestedTogether = 16;  ///< elements

/// Tests at most `size` boxes from `first` on: sixteen elements or eight siblings, as the map
/// places them. Bit i is set if `select(d, boxes, lane)` is true for box i.
template <class D, class Boxes, class Select>
HWY_ATTR HWY_INLINE std::uint32_t selectBoxes(D d, const Boxes& from, std::size_t first,
                                              std::size_t size, const BoxMap& map,
                                              Select&& select) {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
    const auto boxes = BoxLanes<D>::load(from, first + i).mapped(map);
    bits |= bitsOf(d, hn::And(hn::FirstN(d, size - i), select(d, boxes, i))) << i;
  }
  return bits;
}

/// An upper bound on the computed squared distance of a box that is no further than the given one.
/// A computed squared distance is off by less than 2^-20 of itself. If its squares are denormal,
/// outward rounding covers its error.
float boundOf(double distanceSquared) {
  return OutwardRounding::up(static_cast<float>(distanceSquared) * (1.0f + 0x1p-19f));
}

/// Descends depth first from the root, nearest siblings first. select() tests boxes and writes
/// their squared distances to `squares`. A selected node or element is skipped if its distance
/// exceeds `bound` when its turn comes. element(place) is called for each remaining element, and
/// may lower the bound.
template <class Select, class Element>
HWY_ATTR HWY_INLINE void descend(const Octree& octree, const BoxMap& map, PointQueryStack& stack,
                                 const float* squares, const float& bound, Select&& select,
                                 Element&& element) {
  using Entry = PointQueryStack::Entry;
  stack.entries.assign(1, {0, 0});
  while (!stack.entries.empty()) {
    const Entry entry = stack.entries.back();
    stack.entries.pop_back();
    if (entry.distanceSquared > bound) continue;
    const auto [begin, end] = octree.ownRange(entry.node);
    for (std::uint32_t i = begin; i < end; i += kTestedTogether) {
      const std::size_t size = std::min<std::size_t>(kTestedTogether, end - i);
      std::uint32_t bits = selectBoxes(LeafTag(), octree.boxes(), i, size, map, select);
      for (; bits; bits &= bits - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(bits));
        if (squares[lane] <= bound) element(i + lane);
      }
    }
    const OctreeNode child = octree.firstChild(entry.node);
    if (child == 0) continue;
    const std::size_t first = stack.entries.size();
    std::uint32_t bits = selectBoxes(NodeTag(), octree.blocks()[child >> 3], 0, 8, map, select);
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<std::uint32_t>(std::countr_zero(bits));
      const Entry next{squares[slot], child + slot};
      // Sorted with the nearest last, because the last entry is taken first.
      std::size_t place = stack.entries.size();
      stack.entries.push_back(next);
      for (; place > first && stack.entries[place - 1].distanceSquared < next.distanceSquared;
           --place)
        stack.entries[place] = stack.entries[place - 1];
      stack.entries[place] = next;
    }
  }
}

HWY_ATTR void findOverlappingKernel(const Octree& octree, const BoxMap& map, const FloatBox& box,
                                    PointQueryStack& stack) {
  const auto overlapping = [&](auto, const auto& boxes, std::size_t)
                               HWY_ATTR { return boxes.overlapping(box); };
  stack.found.clear();
  if (!selectBoxes(BoxTag(), octree.blocks()[0], 0, 1, map, overlapping)) return;
  std::array<OctreeNode, 512> nodes;  // seven siblings remain on each of at most 61 levels
  std::size_t count = 0;
  nodes[count++] = 0;
  while (count > 0) {
    const OctreeNode node = nodes[--count];
    const auto [begin, end] = octree.ownRange(node);
    for (std::uint32_t i = begin; i < end; i += kTestedTogether) {
      const std::size_t size = std::min<std::size_t>(kTestedTogether, end - i);
      std::uint32_t bits = selectBoxes(LeafTag(), octree.boxes(), i, size, map, overlapping);
      for (; bits; bits &= bits - 1)
        stack.found.push_back(i + static_cast<std::uint32_t>(std::countr_zero(bits)));
    }
    const OctreeNode child = octree.firstChild(node);
    if (child == 0) continue;
    std::uint32_t bits =
        selectBoxes(NodeTag(), octree.blocks()[child >> 3], 0, 8, map, overlapping);
    for (; bits; bits &= bits - 1)
      nodes[count++] = child + static_cast<std::uint32_t>(std::countr_zero(bits));
  }
}

HWY_ATTR void visitNearestKernel(const Octree& octree, const BoxMap& map, const FloatBox& point,
                                 double distanceSquared, PointQueryStack& stack, void* context,
                                 VisitElement visitElement) {
  float bound = boundOf(distanceSquared);
  alignas(64) float squares[kTestedTogether];
  const auto within = [&](auto d, const auto& boxes, std::size_t i) HWY_ATTR {
    const auto distances = boxes.distanceFrom(point);
    hn::Store(distances, d, squares + i);
    return hn::Le(distances, hn::Set(d, bound));
  };
  descend(octree, map, stack, squares, bound, within,
          [&](std::uint32_t place) { bound = boundOf(visitElement(context, place)); });
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(findOverlappingKernel);
HWY_EXPORT(visitNearestKernel);

void findOverlapping(const Octree& octree, const BoxMap& map, const FloatBox& box,
                     PointQueryStack& stack) {
  octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(findOverlappingKernel)(octree, map, box, stack);
}

void visitNearest(const Octree& octree, const BoxMap& map, const FloatBox& point,
                  double distanceSquared, PointQueryStack& stack, void* context,
                  VisitElement visitElement) {
  octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(visitNearestKernel)
  (octree, map, point, distanceSquared, stack, context, visitElement);
}

}  // namespace palpate
#endif
