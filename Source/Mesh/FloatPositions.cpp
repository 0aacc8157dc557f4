#include "Mesh/FloatPositions.h"

#include "Math/Range.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Mesh/FloatPositions.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

HWY_ATTR void toFloatsKernel(const Eigen::Vector3d* positions, std::size_t size,
                             const FloatFrame& frame, FloatPoint* out) {
  std::size_t i = 0;
#if HWY_MAX_BYTES >= 32
  // Each load has a point and the next point's x, which is scaled to zero.
  const hn::FixedTag<double, 4> d;
  const hn::FixedTag<float, 4> df;
  const double down = frame.shrinking(), up = frame.growing();
  alignas(32) const double corner[4] = {frame.origin[0] * down, frame.origin[1] * down,
                                        frame.origin[2] * down, 0.0},
                           downs[4] = {down, down, down, 0.0};
  const auto origin = hn::Load(d, corner), shrinking = hn::Load(d, downs), growing = hn::Set(d, up);
  const auto most = hn::Set(d, kLargestFloat), least = hn::Neg(most);
  for (; i + 1 < size; ++i) {
    const auto point = (hn::LoadU(d, positions[i].data()) * shrinking - origin) * growing;
    hn::Store(hn::DemoteTo(df, hn::Min(hn::Max(point, least), most)), df, &out[i].x);
  }
#endif
  for (; i < size; ++i) out[i] = frame(positions[i]);
}

/// Copies the coordinates of positions, and extends bounds. Returns whether all are in range.
HWY_ATTR bool copyInRangeKernel(const double* from, std::size_t size, double* to, double* lower,
                                double* upper) {
  const hn::CappedTag<double, 8> d;
  const std::size_t lanes = hn::Lanes(d);
  // Three vectors hold whole positions, so that a lane always has the same axis. NaN is not at most
  // anything.
  const auto most = hn::Set(d, kLargestMeasure), none = hn::Inf(d);
  const auto all = hn::Eq(most, most);
  hn::Mask<decltype(d)> good[3] = {all, all, all};
  hn::Vec<decltype(d)> least[3] = {none, none, none},
                       largest[3] = {hn::Neg(none), hn::Neg(none), hn::Neg(none)};
  std::size_t i = 0;
  for (; i + 3 * lanes <= size; i += 3 * lanes)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto v = hn::LoadU(d, from + i + k * lanes);
      hn::StoreU(v, d, to + i + k * lanes);
      good[k] = hn::And(good[k], hn::Le(hn::Abs(v), most));
      least[k] = hn::Min(least[k], v);
      largest[k] = hn::Max(largest[k], v);
    }
  bool isGood = hn::AllTrue(d, hn::And(hn::And(good[0], good[1]), good[2]));
  double lowest[24], highest[24];
  for (std::size_t k = 0; k < 3; ++k) {
    hn::StoreU(least[k], d, lowest + k * lanes);
    hn::StoreU(largest[k], d, highest + k * lanes);
  }
  const auto add = [&](std::size_t axis, double low, double high) {
    lower[axis] = std::min(lower[axis], low);
    upper[axis] = std::max(upper[axis], high);
  };
  for (std::size_t lane = 0; lane < 3 * lanes; ++lane) add(lane % 3, lowest[lane], highest[lane]);
  for (; i < size; ++i) {
    to[i] = from[i];
    isGood &= isWithinRange(from[i]);
    add(i % 3, from[i], from[i]);
  }
  return isGood;
}

/// Writes each value at its rank. Infinities must fill the last vector.
HWY_ATTR void sortFewKernel(const double* values, std::size_t size, double* sorted) {
  const hn::CappedTag<double, 8> d;
  for (std::size_t i = 0; i < size; ++i) {
    const auto value = hn::Set(d, values[i]);
    std::size_t less = 0, upTo = 0;
    for (std::size_t k = 0; k < size; k += hn::Lanes(d)) {
      const auto others = hn::Load(d, values + k);
      less += hn::CountTrue(d, hn::Lt(others, value));
      upTo += hn::CountTrue(d, hn::Le(others, value));
    }
    for (; less < upTo; ++less) sorted[less] = values[i];
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(sortFewKernel);

SampledExtent sampleExtent(std::span<const Eigen::Vector3d> positions) {
  SampledExtent extent;
  if (positions.empty()) return extent;
  constexpr std::size_t kMax = 31;
  const std::size_t count = std::min(kMax, positions.size());
  alignas(64) std::array<double, kMax + 1> sample;
  sample.fill(std::numeric_limits<double>::infinity());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < count; ++i)
      sample[i] = positions[i * positions.size() / count][axis];
    std::array<double, kMax> sorted;
    HWY_DYNAMIC_DISPATCH(sortFewKernel)(sample.data(), count, sorted.data());
    extent.median[axis] = sorted[count / 2];
    // Halved, because the difference of two doubles may be beyond their range.
    const double first = sorted[count / 8], seventh = sorted[count * 7 / 8];
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
  PALPATE_ASSERT(frame.scale > 0.0);
  HWY_DYNAMIC_DISPATCH(toFloatsKernel)(positions.data(), positions.size(), frame, out);
}

HWY_EXPORT(copyInRangeKernel);

std::size_t copyFinite(std::span<const Eigen::Vector3d> positions, Eigen::Vector3d* out,
                       Eigen::AlignedBox3d& bounds) {
  if (positions.empty() || HWY_DYNAMIC_DISPATCH(copyInRangeKernel)(
                               positions[0].data(), 3 * positions.size(), out->data(),
                               bounds.min().data(), bounds.max().data()))
    return positions.size();
  std::size_t i = 0;
  while (isWithinRange(positions[i])) ++i;
  return i;
}

}  // namespace palpate
#endif
