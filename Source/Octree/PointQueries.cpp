#include "Octree/PointQueries.h"

#include <algorithm>
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

HWY_ATTR void findOverlappingKernel(const Octree& octree, const BoxMap& map, const FloatBox& box,
                                    PointQueryStack& stack) {
  const auto overlapping = [&](auto, const auto& boxes, std::size_t)
                               HWY_ATTR { return boxes.overlapping(box); };
  stack.found.clear();
  if (!selectBoxes(BoxTag(), octree.blocks()[0], 0, 1, map, overlapping)) return;
  for (Walk walk(octree); walk.next();) {
    for (std::uint32_t i = walk.begin(); i < walk.end(); i += kTestedTogether) {
      const std::size_t size = std::min<std::size_t>(kTestedTogether, walk.end() - i);
      std::uint32_t bits = selectBoxes(LeafTag(), octree.boxes(), i, size, map, overlapping);
      for (; bits; bits &= bits - 1)
        stack.found.push_back(i + static_cast<std::uint32_t>(std::countr_zero(bits)));
    }
    if (walk.hasChildren())
      walk.enter(selectBoxes(NodeTag(), walk.children(), 0, kChildren, map, overlapping));
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(findOverlappingKernel);

void findOverlapping(const Octree& octree, const BoxMap& map, const FloatBox& box,
                     PointQueryStack& stack) {
  octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(findOverlappingKernel)(octree, map, box, stack);
}

}  // namespace palpate
#endif
