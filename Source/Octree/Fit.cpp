#include "Octree/Fit.h"

#include "Core/Assert.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/Fit.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

HWY_ATTR void fitBlocksKernel(OctreeBlock* blocks, const OctreeNode* parents, std::size_t begin,
                              std::size_t end) {
  const hn::CappedTag<float, kChildren> d;
  for (std::size_t b = end; b-- > begin;) {
    const OctreeBlock& block = blocks[b];
    OctreeBlock& parent = blocks[blockOf(parents[b])];
    const unsigned slot = slotOf(parents[b]);
    PALPATE_ASSERT(b == 0 || blockOf(parents[b]) < b);
    FloatBox box;
    for (int k = 0; k < 3; ++k) {
      auto lower = hn::Load(d, block.lower[k]), upper = hn::Load(d, block.upper[k]);
      for (std::size_t i = hn::Lanes(d); i < kChildren; i += hn::Lanes(d)) {
        lower = hn::Min(lower, hn::Load(d, block.lower[k] + i));
        upper = hn::Max(upper, hn::Load(d, block.upper[k] + i));
      }
      box.lower[k] = hn::GetLane(hn::MinOfLanes(d, lower));
      box.upper[k] = hn::GetLane(hn::MaxOfLanes(d, upper));
    }
    if (parent.begin[slot] != block.begin[0]) box.add(parent.box(slot));
    parent.setBox(slot, box);
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(fitBlocksKernel);

void fitBlocks(OctreeBlock* blocks, const OctreeNode* parents, std::size_t begin, std::size_t end) {
  HWY_DYNAMIC_DISPATCH(fitBlocksKernel)(blocks, parents, begin, end);
}

}  // namespace palpate
#endif
