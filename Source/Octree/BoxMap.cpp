#include "Octree/BoxMap.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/BoxMap.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

HWY_ATTR void mapKernel(const BoxMap& map, const FloatBox& box, FloatBox& mapped) {
  mapped = BoxLanes<BoxTag>::of(box).turned(map).first();
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(mapKernel);

FloatBox BoxMap::operator()(const FloatBox& box) const {
  if (count == 0 || box.empty()) return box;
  FloatBox mapped;
  HWY_DYNAMIC_DISPATCH(mapKernel)(*this, box, mapped);
  return mapped;
}

}  // namespace palpate
#endif
