#include "SimdPath.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "SimdPath.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
inline const char* pathName() { return hwy::TargetName(HWY_TARGET); }
}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {
HWY_EXPORT(pathName);
}

namespace palpate::benchmark {

std::string simdPath() { return HWY_DYNAMIC_DISPATCH(pathName)(); }

std::vector<std::string> simdPaths() {
  std::vector<std::string> names;
  hwy::SetSupportedTargetsForTest(0);
  const std::int64_t targets = hwy::SupportedTargets() & HWY_TARGETS;
  for (std::int64_t bit = 1; bit > 0; bit <<= 1)
    if (targets & bit) names.push_back(hwy::TargetName(bit));
  return names;
}

void chooseSimdPath(const std::string& name) {
  std::int64_t chosen = 0;
  for (std::int64_t bit = 1; bit > 0; bit <<= 1)
    if ((HWY_TARGETS & bit) && name == hwy::TargetName(bit)) chosen = bit;
  hwy::SetSupportedTargetsForTest(chosen);
  hwy::GetChosenTarget().DeInit();
}

}  // namespace palpate::benchmark
#endif
