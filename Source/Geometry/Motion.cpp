#include "Geometry/Motion.h"

#include "Math/Tolerances.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

using Eigen::Vector3d;

void MotionRange::add(const MotionRange& other) {
  if (other.count == 0) return;
  lower = count == 0 ? other.lower : Vector3d(lower.cwiseMin(other.lower));
  upper = count == 0 ? other.upper : Vector3d(upper.cwiseMax(other.upper));
  sum += other.sum;
  squares += other.squares;
  count += other.count;
}

MotionRange motionRange(const Positions& before, const Positions& now, std::size_t begin,
                        std::size_t end) {
  MotionRange range;
  std::size_t i = begin;
  if (end - begin >= 2 && !before.isPlaced() && !now.isPlaced()) {
    // Two vertices at a time, as six numbers, for whatever vectors the compiler has.
    using Two = Eigen::Array<double, 6, 1>;
    const auto displacement = [&](std::size_t first) -> Two {
      return Eigen::Map<const Two>(now.body()[first].data()) -
             Eigen::Map<const Two>(before.body()[first].data());
    };
    Two lower = displacement(i), upper = lower, sum = Two::Zero(), squares = Two::Zero();
    for (; i + 2 <= end; i += 2) {
      const Two moved = displacement(i);
      lower = lower.min(moved);
      upper = upper.max(moved);
      sum += moved;
      squares += moved * moved;
    }
    for (int k = 0; k < 6; k += 3) {
      const auto part = [&](const Two& two) -> Vector3d { return two.segment<3>(k).matrix(); };
      range.add(
          {part(lower), part(upper), part(sum), part(squares).sum(), double((i - begin) / 2)});
    }
  }
  for (; i < end; ++i) {
    const Vector3d moved = now[i] - before[i];
    range.add({moved, moved, moved, moved.squaredNorm(), 1.0});
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

double meanMotion(const MotionRange& a, const MotionRange& b) {
  if (a.count == 0 || b.count == 0) return 0.0;
  const double common = (a.sum / a.count).dot(b.sum / b.count);
  return std::sqrt(std::max(0.0, a.squares / a.count + b.squares / b.count - 2.0 * common));
}

}  // namespace palpate
