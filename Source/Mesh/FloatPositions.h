#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "Math/Box.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>

namespace palpate {

struct alignas(16) FloatPoint {
  float x, y, z, unused;

  FloatBox box() const { return {{x, y, z, 0}, {x, y, z, 0}}; }
};

/// The frame of a geometry's floats: f = (position - origin) * scale.
///
/// The origin is the median of a sample of the geometry's own positions. The floats therefore
/// resolve most of the geometry wherever the scene is, even if single vertices are far away. The
/// scale is a power of two shared by a scene, which only keeps floats within their range.
struct FloatFrame {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double scale = 1.0;

  /// (to - from) scale, also where the difference is beyond the range of doubles.
  Eigen::Vector3d scaled(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
    return (to * shrinking() - from * shrinking()) * growing();
  }
  double shrinking() const { return std::min(scale, 1.0); }
  double growing() const { return std::max(scale, 1.0); }

  FloatPoint operator()(const Eigen::Vector3d& position) const {
    return rounded(scaled(origin, position));
  }
  /// Rounds to nearest and clamps to kLargestFloat. Clamping brings no two points further apart.
  static FloatPoint rounded(const Eigen::Vector3d& v) {
    const auto of = [&](int k) {
      constexpr double kMax = kLargestFloat;
      return static_cast<float>(std::min(std::max(v[k], -kMax), kMax));
    };
    return {of(0), of(1), of(2), 0.0f};
  }
  /// A box of floats in L, relative to the origin. None if its contents may reach beyond it.
  std::optional<Eigen::AlignedBox3d> lengthsOf(const FloatBox& box) const {
    if (box.mayBeClamped()) return {};
    const double unit = 1.0 / scale;
    const auto corner = [&](const std::array<float, 4>& c) {
      return Eigen::Vector3d(unit * c[0], unit * c[1], unit * c[2]);
    };
    return Eigen::AlignedBox3d(corner(box.lower), corner(box.upper));
  }
  friend bool operator==(const FloatFrame& l, const FloatFrame& r) {
    return l.origin == r.origin && l.scale == r.scale;
  }
};

/// The extent of a sample of up to 31 evenly spaced positions. median: of each axis. spread: the
/// largest distance along an axis between the first and the last eighth. A few vertices far away
/// change neither.
struct SampledExtent {
  Eigen::Vector3d median = Eigen::Vector3d::Zero();
  double spread = 0.0;
};
SampledExtent sampleExtent(std::span<const Eigen::Vector3d> positions);

/// A power of two that brings `spread` to [2^-16, 2^16], in steps of 2^32 so that it hardly ever
/// changes.
double frameScale(double spread);

/// Converts positions to floats of the frame. `out` is as long as `positions`.
void toFloats(std::span<const Eigen::Vector3d> positions, const FloatFrame&, FloatPoint* out);

/// Copies positions, and extends bounds by them. Returns the index of the first vertex that is not
/// finite or has a coordinate beyond kLargestMeasure, or the size if there is none.
std::size_t copyFinite(std::span<const Eigen::Vector3d> positions, Eigen::Vector3d* out,
                       Eigen::AlignedBox3d& bounds);

}  // namespace palpate
