#pragma once

#include "Core/Buffer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace palpate {

/// Floats are clamped to this magnitude. Boxes of scenes beyond float's range therefore stay finite
/// and conservative.
constexpr float kLargestFloat = 0x1p120f;

/// An axis-aligned box in a geometry's float frame, rounded outward. Fourth lanes are padding.
struct alignas(16) FloatBox {
  /// The bounds of an empty box, which overlaps nothing and is neutral for add().
  static constexpr float kEmptyLower = std::numeric_limits<float>::infinity();

  std::array<float, 4> lower{kEmptyLower, kEmptyLower, kEmptyLower, 0};
  std::array<float, 4> upper{-kEmptyLower, -kEmptyLower, -kEmptyLower, 0};

  bool overlaps(const FloatBox& other) const {
    bool all = true;
    for (int k = 0; k < 3; ++k) all &= lower[k] <= other.upper[k] && upper[k] >= other.lower[k];
    return all;
  }
  /// Whether the contents may reach beyond the box because it was clamped.
  bool mayBeClamped() const {
    bool within = true;
    for (int k = 0; k < 3; ++k) within &= lower[k] > -kLargestFloat && upper[k] < kLargestFloat;
    return !within;
  }
  bool empty() const { return !(lower[0] <= upper[0]); }
  /// The largest magnitude of a coordinate in the box; 0 for an empty one.
  float reach() const {
    float most = 0;
    for (int k = 0; k < 3; ++k) most = std::max({most, -lower[k], upper[k]});
    return most;
  }
  void add(const FloatBox& other) {
    for (int k = 0; k < 3; ++k) {
      lower[k] = std::min(lower[k], other.lower[k]);
      upper[k] = std::max(upper[k], other.upper[k]);
    }
  }
};

/// Boxes as one array per bound, each readable kPadding elements past its size.
struct BoxArrays {
  static constexpr std::size_t kPadding = 16;  ///< the widest SIMD vector of floats

  std::array<Buffer<float>, 3> lower, upper;

  void resize(std::size_t size) {  ///< its values are indeterminate
    for (int k = 0; k < 3; ++k) {
      resizeSparingly(lower[k], size + kPadding);
      resizeSparingly(upper[k], size + kPadding);
    }
  }
  void releaseMemory() {
    for (int k = 0; k < 3; ++k) {
      releaseSpare(lower[k]);
      releaseSpare(upper[k]);
    }
  }
  FloatBox operator[](std::size_t i) const {
    return {{lower[0][i], lower[1][i], lower[2][i], 0}, {upper[0][i], upper[1][i], upper[2][i], 0}};
  }
};

/// Outward rounding of bounds that were rounded to nearest float.
///
/// Let v be a coordinate in the frame, fl64(x - origin) * scale with |error| <= 2^-53 |v|. Let f be
/// the float nearest to it: |f - v| <= 2^-24 |v| where f is normal, <= 2^-150 where it is denormal.
/// kRelative |f| = 2^-22 |f| covers that, the 2^-53, and the rounding of the subtraction itself (<=
/// 2^-24 of its result), with a factor of about two to spare. kAbsolute covers denormals. It is so
/// large that kAbsolute * kRelative is not denormal, because a denormal product costs many
/// processors a hundred cycles, and coordinates of zero are common. Both bounds are monotone in f,
/// so the bound of a set is the bound of its least element. Math/BoxRounding.h does the same in
/// SIMD lanes.
struct OutwardRounding {
  static constexpr float kRelative = 0x1p-22f;
  static constexpr float kAbsolute = 0x1p-103f;
  static_assert(kAbsolute * kRelative >= std::numeric_limits<float>::min());
  static float down(float f) { return f - (std::fabs(f) * kRelative + kAbsolute); }
  static float up(float f) { return f + (std::fabs(f) * kRelative + kAbsolute); }
  static float up(double value) { return up(static_cast<float>(value)); }
  static FloatBox outward(FloatBox box) {
    for (int k = 0; k < 3; ++k) {
      box.lower[k] = down(box.lower[k]);
      box.upper[k] = up(box.upper[k]);
    }
    return box;
  }
};

}  // namespace palpate
