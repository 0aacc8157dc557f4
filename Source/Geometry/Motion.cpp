#include "Geometry/Motion.h"

#include "Math/Tolerances.h"

#include <limits>

namespace palpate {

using Eigen::Vector3d;

MotionRange motionRange(std::span<const Vector3d> before, std::span<const Vector3d> now) {
  MotionRange range;
  if (now.empty()) return range;
  // Four vertices at a time, as twelve numbers, for whatever vectors the compiler has.
  using Four = Eigen::Array<double, 12, 1>;
  const auto displacement = [&](std::size_t i) -> Four {
    return Eigen::Map<const Four>(now[i].data()) - Eigen::Map<const Four>(before[i].data());
  };
  range.lower = range.upper = now[0] - before[0];
  std::size_t i = 0;
  if (now.size() >= 4) {
    Four lower = displacement(0), upper = lower;
    for (i = 4; i + 4 <= now.size(); i += 4) {
      const Four moved = displacement(i);
      lower = lower.min(moved);
      upper = upper.max(moved);
    }
    for (int k = 0; k < 12; k += 3) {
      range.lower = range.lower.cwiseMin(lower.segment<3>(k).matrix());
      range.upper = range.upper.cwiseMax(upper.segment<3>(k).matrix());
    }
  }
  for (; i < now.size(); ++i) {
    const Vector3d moved = now[i] - before[i];
    range.lower = range.lower.cwiseMin(moved);
    range.upper = range.upper.cwiseMax(moved);
  }
  return range;
}

double largestMotion(const MotionRange& a, const MotionRange& b) {
  const Vector3d most = (a.upper - b.lower).cwiseAbs().cwiseMax((b.upper - a.lower).cwiseAbs());
  const double motion = most.stableNorm() * (1.0 + kMotionError);
  return motion >= 0.0 ? motion : std::numeric_limits<double>::infinity();  // of NaN, too
}

double smallestMotion(const MotionRange& a, const MotionRange& b) {
  const Vector3d least = (a.lower - b.upper).cwiseMax(b.lower - a.upper).cwiseMax(0.0);
  return least.stableNorm() * (1.0 - kMotionError);
}

}  // namespace palpate
