#include "Geometry/FloatPositions.h"

#include <algorithm>
#include <array>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Geometry/FloatPositions.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

HWY_ATTR void toFloatsKernel(const Eigen::Vector3d* positions, std::size_t size,
                             const FloatFrame& frame, FloatPoint* out) {
  constexpr double kMost = kLargestFloat;
  std::size_t i = 0;
#if HWY_MAX_BYTES >= 32
  // A point and the next one's x, which comes to nothing.
  const hn::FixedTag<double, 4> d;
  const hn::FixedTag<float, 4> df;
  alignas(32) const double corner[4] = {frame.origin[0], frame.origin[1], frame.origin[2], 0.0},
                           scales[4] = {frame.scale, frame.scale, frame.scale, 0.0};
  const auto origin = hn::Load(d, corner), scale = hn::Load(d, scales);
  const auto least = hn::Set(d, -kMost), most = hn::Set(d, kMost);
  for (; i + 1 < size; ++i) {
    const auto point = (hn::LoadU(d, positions[i].data()) - origin) * scale;
    hn::Store(hn::DemoteTo(df, hn::Min(hn::Max(point, least), most)), df, &out[i].x);
  }
#endif
  for (; i < size; ++i) {
    const auto of = [&](int k) {
      const double v = (positions[i][k] - frame.origin[k]) * frame.scale;
      return static_cast<float>(std::min(std::max(v, -kMost), kMost));
    };
    out[i] = {of(0), of(1), of(2), 0.0f};
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

SampledExtent sampleExtent(std::span<const Eigen::Vector3d> positions) {
  SampledExtent extent;
  if (positions.empty()) return extent;
  constexpr std::size_t kMost = 31;
  const std::size_t count = std::min(kMost, positions.size());
  std::array<double, kMost> sample;
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < count; ++i)
      sample[i] = positions[i * positions.size() / count][axis];
    const auto begin = sample.begin(), end = begin + static_cast<std::ptrdiff_t>(count);
    const auto at = [&](auto from, std::size_t eighths, auto to) {
      const auto place = begin + static_cast<std::ptrdiff_t>(count * eighths / 8);
      std::nth_element(from, place, to);
      return place;
    };
    const auto middle = at(begin, 4, end);
    extent.median[axis] = *middle;
    // Halved: the difference of two doubles may be beyond their range.
    const double first = *at(begin, 1, middle), seventh = *at(middle, 7, end);
    extent.spread = std::max(extent.spread, 2.0 * (0.5 * seventh - 0.5 * first));
  }
  return extent;
}

double frameScale(double spread) {
  if (!(spread > 0.0)) return 1.0;
  const int exponent = std::isinf(spread) ? 1024 : std::ilogb(spread);
  const int steps = std::clamp((exponent + (exponent < 0 ? -16 : 16)) / 32, -31, 31);
  return std::ldexp(1.0, -32 * steps);
}

HWY_EXPORT(toFloatsKernel);

void toFloats(std::span<const Eigen::Vector3d> positions, const FloatFrame& frame,
              FloatPoint* out) {
  HWY_DYNAMIC_DISPATCH(toFloatsKernel)(positions.data(), positions.size(), frame, out);
}

std::size_t copyFinite(std::span<const Eigen::Vector3d> positions, Eigen::Vector3d* out) {
  // x * 0 is 0 for finite x and NaN else; NaN survives any sum.
  Eigen::Vector3d poison = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < positions.size(); ++i) {
    out[i] = positions[i];
    poison += positions[i] * 0.0;
  }
  if (poison.sum() == 0.0) return positions.size();
  std::size_t i = 0;
  while (positions[i].allFinite()) ++i;
  return i;
}

}  // namespace palpate
#endif
