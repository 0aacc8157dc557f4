#include "Octree/BoxMap.h"

#include "Math/Box.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/BoxMap.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

HWY_ATTR void mapKernel(const BoxMap& map, const FloatBox& box, FloatBox& mapped) {
  mapped = BoxLanes<BoxTag>::of(box).mapped(map).first();
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(mapKernel);

void setShift(float& lower, float& upper, double offset, double thickness) {
  constexpr double kMax = 0x1p125;      // boxes of kLargestFloat stay finite
  constexpr double kFinite = 0x1p1000;  // so is each sum; the error covers what is cut off
  PALPATE_ASSERT(!(thickness < 0));
  const auto clamped = [](double v, double most) { return std::min(std::max(v, -most), most); };
  const double moved = clamped(offset, kFinite), widened = clamped(thickness, kFinite);
  const double error = (std::abs(moved) + widened) * OutwardRounding::kRelative;
  lower = static_cast<float>(clamped(moved - widened - error, kMax));
  upper = static_cast<float>(clamped(moved + widened + error, kMax));
}

void setShift(std::array<float, 4>& lower, std::array<float, 4>& upper,
              const std::array<double, 3>& offset, double thickness) {
  for (int k = 0; k < 3; ++k) setShift(lower[k], upper[k], offset[k], thickness);
}

void setEnd(BoxMap::End& end, const std::array<std::array<double, 3>, 3>& matrix,
            const std::array<double, 3>& offset, double thickness, double error) {
  for (int k = 0; k < 3; ++k)
    for (int j = 0; j < 3; ++j) end.matrix[k][j] = static_cast<float>(matrix[k][j]);
  setShift(end.shiftLower, end.shiftUpper, offset, thickness + error);
}

FloatBox BoxMap::operator()(const FloatBox& box) const {
  if (count == 0 || box.empty()) return box;
  FloatBox mapped;
  HWY_DYNAMIC_DISPATCH(mapKernel)(*this, box, mapped);
  return mapped;
}

}  // namespace palpate
#endif
