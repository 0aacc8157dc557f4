#include "Mesh/Motion.h"

#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Mesh/Motion.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace motion {

namespace hn = hwy::HWY_NAMESPACE;

/// The number of coordinates of eight consecutive vertices.
constexpr std::size_t kBlock = 24;
using D = hn::CappedTag<double, 8>;
using V = hn::Vec<D>;

/// Finds the least and the largest displacement over so many blocks, for each coordinate of a
/// block. It handles three vectors at a time; with AVX-512 these are eight vertices.
HWY_ATTR void addBlocks(const double* before, const double* now, std::size_t blocks,
                        double (&lowest)[kBlock], double (&highest)[kBlock]) {
  const D d;
  for (std::size_t first = 0; first < kBlock; first += 3 * hn::Lanes(d)) {
    const auto moved = [&](std::size_t block, std::size_t i) HWY_ATTR {
      const std::size_t at = kBlock * block + first + i * hn::Lanes(d);
      return hn::LoadU(d, now + at) - hn::LoadU(d, before + at);
    };
    V lower[3], upper[3];
    for (std::size_t i = 0; i < 3; ++i) lower[i] = upper[i] = moved(0, i);
    for (std::size_t block = 1; block < blocks; ++block)
      for (std::size_t i = 0; i < 3; ++i) {
        const V v = moved(block, i);
        lower[i] = hn::Min(lower[i], v);
        upper[i] = hn::Max(upper[i], v);
      }
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t at = first + i * hn::Lanes(d);
      hn::StoreU(lower[i], d, lowest + at);
      hn::StoreU(upper[i], d, highest + at);
    }
  }
}

}  // namespace motion

using motion::addBlocks;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(addBlocks);

constexpr std::size_t kVertices = 8;  ///< in a block

using Eigen::Vector3d;

constexpr std::size_t kSampled = 512;  ///< pairs of vertices that fastShare() samples
constexpr std::size_t kStride = 197;   ///< spreads them over the second mesh; any odd number

void MotionRange::add(const MotionRange& other) {
  if (other.isEmpty) return;
  lower = isEmpty ? other.lower : Vector3d(lower.cwiseMin(other.lower));
  upper = isEmpty ? other.upper : Vector3d(upper.cwiseMax(other.upper));
  isEmpty = false;
}

MotionRange motionRange(std::span<const Vector3d> before, std::span<const Vector3d> now) {
  PALPATE_ASSERT(before.size() == now.size());
  MotionRange range;
  const std::size_t blocks = now.size() / kVertices;
  if (blocks > 0) {
    double lower[3 * kVertices], upper[3 * kVertices];
    HWY_DYNAMIC_DISPATCH(addBlocks)(before[0].data(), now[0].data(), blocks, lower, upper);
    const Eigen::Map<const Eigen::Matrix<double, 3, kVertices>> lowest(lower), highest(upper);
    range.add({lowest.rowwise().minCoeff(), highest.rowwise().maxCoeff(), false});
  }
  for (std::size_t i = blocks * kVertices; i < now.size(); ++i)
    range.add({now[i] - before[i], now[i] - before[i], false});
  return range;
}

MotionRange motionRange(const Positions& before, const Positions& now) {
  PALPATE_ASSERT(before.size() == now.size());
  MotionRange range;
  if (!before.isPlaced() && !now.isPlaced()) {
    const auto changed = now.changesSince(before.bodyRevision());
    if (!changed) return motionRange(before.body(), now.body());
    const auto part = [&](const Positions& all) {
      return all.body().subspan(changed->begin, changed->size());
    };
    range = motionRange(part(before), part(now));
    if (changed->size() < now.size()) range.add({.isEmpty = false});
    return range;
  }
  for (std::size_t i = 0; i < now.size(); ++i)
    range.add({now[i] - before[i], now[i] - before[i], false});
  return range;
}

double largestMotion(const MotionRange& a, const MotionRange& b) {
  const Vector3d most = (a.upper - b.lower).cwiseAbs().cwiseMax((b.upper - a.lower).cwiseAbs());
  const double motion = stableLength(most) * (1.0 + kMotionError);
  return motion >= 0.0 ? motion : std::numeric_limits<double>::infinity();  // for NaN, too
}

double smallestMotion(const MotionRange& a, const MotionRange& b) {
  const Vector3d least = (a.lower - b.upper).cwiseMax(b.lower - a.upper).cwiseMax(0.0);
  return stableLength(least) * (1.0 - kMotionError);
}

double fastShare(const TriangleMesh& a, const TriangleMesh& b, double limit) {
  const std::size_t countA = a.now.size(), countB = b.now.size();
  if (countA == 0 || countB == 0) return 0.0;
  std::size_t fast = 0;
  for (std::size_t i = 0; i < kSampled; ++i) {
    const std::size_t v = i * countA / kSampled, w = i * kStride % kSampled * countB / kSampled;
    const Vector3d motion = (a.now[v] - a.before[v]) - (b.now[w] - b.before[w]);
    fast += !(motion.squaredNorm() <= limit * limit);
  }
  return static_cast<double>(fast) / kSampled;
}

}  // namespace palpate
#endif
