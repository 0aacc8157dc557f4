#include "Core/SimdPath.h"

#include <algorithm>
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

namespace {

/// The usual name of an instruction set. Highway calls AVX-512 "AVX3".
std::string nameOf(std::int64_t target) {
  return target == HWY_AVX3 ? "AVX-512" : hwy::TargetName(target);
}

}  // namespace

HWY_EXPORT(targetKernel);

std::string currentSimdPath() { return nameOf(HWY_DYNAMIC_DISPATCH(targetKernel)()); }

std::vector<std::string> simdPaths() {
  useSimdPath("");
  std::vector<std::string> paths;
  for (std::int64_t targets = hwy::SupportedTargets() & HWY_TARGETS; targets != 0;
       targets &= targets - 1)
    paths.push_back(nameOf(targets & -targets));
  return paths;
}

void useSimdPath(const std::string& path) {
  hwy::SetSupportedTargetsForTest(0);
  for (std::int64_t targets = hwy::SupportedTargets() & HWY_TARGETS; targets != 0;
       targets &= targets - 1)
    if (nameOf(targets & -targets) == path) {
      hwy::SetSupportedTargetsForTest(targets & -targets);
      break;
    }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

bool hideSimdPaths(const std::vector<std::string>& paths) {
  std::int64_t hidden = 0;
  std::size_t found = 0;
  for (std::int64_t targets = HWY_TARGETS; targets != 0; targets &= targets - 1)
    if (std::find(paths.begin(), paths.end(), nameOf(targets & -targets)) != paths.end()) {
      hidden |= targets & -targets;
      ++found;
    }
  hwy::DisableTargets(hidden);
  return found == paths.size();
}

}  // namespace palpate
#endif
