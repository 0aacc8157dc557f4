#include "Core/SimdPath.h"

#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Core/SimdPath.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

std::int64_t targetKernel() { return HWY_TARGET; }

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(targetKernel);

std::string currentSimdPath() { return hwy::TargetName(HWY_DYNAMIC_DISPATCH(targetKernel)()); }

std::vector<std::string> simdPaths() {
  useSimdPath("");
  std::vector<std::string> paths;
  for (std::int64_t targets = hwy::SupportedTargets() & HWY_TARGETS; targets != 0;
       targets &= targets - 1)
    paths.push_back(hwy::TargetName(targets & -targets));
  return paths;
}

void useSimdPath(const std::string& path) {
  hwy::SetSupportedTargetsForTest(0);
  for (std::int64_t targets = hwy::SupportedTargets() & HWY_TARGETS; targets != 0;
       targets &= targets - 1)
    if (hwy::TargetName(targets & -targets) == path) {
      hwy::SetSupportedTargetsForTest(targets & -targets);
      break;
    }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace palpate
#endif
