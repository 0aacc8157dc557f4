#include "Geometry/FloatPositions.h"

#include <algorithm>
#include <array>
#include <cmath>

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

void toFloats(std::span<const Eigen::Vector3d> positions, const FloatFrame& frame,
              FloatPoint* out) {
  const double x = frame.origin[0], y = frame.origin[1], z = frame.origin[2], scale = frame.scale;
  const auto clamped = [](double v) {
    return static_cast<float>(std::min(std::max(v, -double{kLargestFloat}), double{kLargestFloat}));
  };
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Eigen::Vector3d& p = positions[i];
    out[i] = {clamped((p[0] - x) * scale), clamped((p[1] - y) * scale), clamped((p[2] - z) * scale),
              0.0f};
  }
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
