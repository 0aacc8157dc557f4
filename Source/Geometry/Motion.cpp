#include "Geometry/Motion.h"

#include "Math/Tolerances.h"

#include <algorithm>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Geometry/Motion.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Of eight vertices after each other, coordinate by coordinate.
constexpr std::size_t kBlock = 24;
using D = hn::CappedTag<double, 8>;
using V = hn::Vec<D>;

/// `blocks` of them, into as many sums. Three vectors' worth of each at a time, which is what
/// registers hold.
HWY_ATTR void addBlocks(const double* before, const double* now, std::size_t blocks,
                        double (&out)[4][kBlock]) {
  const D d;
  for (std::size_t first = 0; first < kBlock; first += 3 * hn::Lanes(d)) {
    const auto moved = [&](std::size_t block, std::size_t i) HWY_ATTR {
      const std::size_t at = kBlock * block + first + i * hn::Lanes(d);
      return hn::LoadU(d, now + at) - hn::LoadU(d, before + at);
    };
    V lower[3], upper[3], sum[3], squares[3];
    for (std::size_t i = 0; i < 3; ++i) {
      lower[i] = upper[i] = moved(0, i);
      sum[i] = squares[i] = hn::Zero(d);
    }
    for (std::size_t block = 0; block < blocks; ++block)
      for (std::size_t i = 0; i < 3; ++i) {
        const V v = moved(block, i);
        lower[i] = hn::Min(lower[i], v);
        upper[i] = hn::Max(upper[i], v);
        sum[i] = sum[i] + v;
        squares[i] = squares[i] + v * v;
      }
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t at = first + i * hn::Lanes(d);
      hn::StoreU(lower[i], d, out[0] + at);
      hn::StoreU(upper[i], d, out[1] + at);
      hn::StoreU(sum[i], d, out[2] + at);
      hn::StoreU(squares[i], d, out[3] + at);
    }
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(addBlocks);

constexpr std::size_t kVertices = 8;  ///< of a block

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
  const std::size_t blocks = (end - begin) / kVertices;
  if (blocks > 0 && !before.isPlaced() && !now.isPlaced()) {
    double found[4][3 * kVertices];
    HWY_DYNAMIC_DISPATCH(addBlocks)
    (before.body()[begin].data(), now.body()[begin].data(), blocks, found);
    for (std::size_t k = 0; k < 3 * kVertices; k += 3) {
      const auto part = [&](int which) -> Vector3d {
        return Eigen::Map<const Vector3d>(found[which] + k);
      };
      range.add({part(0), part(1), part(2), part(3).sum(), static_cast<double>(blocks)});
    }
    i += blocks * kVertices;
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
#endif
