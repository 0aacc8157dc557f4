#pragma once

#include "Math/Box.h"

#include <array>

namespace palpate {

/// Brings boxes of one float frame into another: turned and shifted; by two maps, of the ends of a
/// step, to the box of both.
///
/// Rounding. With S the sum of |m_kj| (|centre_j| + half_j), S bounds each corner's turned
/// coordinate. Of S the matrix' conversion to float takes 2^-24, centre and half 2^-24 each, three
/// products and two sums each at most 2^-22 in all: together less than 2^-21, and kRelative doubles
/// that. setEnd() has the shift's part. A box clamped to float's range (kLargestFloat) may reach
/// anywhere. An empty box gives NaN, which overlaps nothing.
struct BoxMap {
  static constexpr float kRelative = 0x1p-20f;

  struct End {
    float matrix[3][3];
    std::array<float, 4> shiftLower{}, shiftUpper{};
  };
  std::array<End, 2> ends{};
  int count = 0;  ///< of ends; 0: boxes stay

  /// Empty boxes stay. BoxLanes::turned() has the arithmetic.
  FloatBox operator()(const FloatBox&) const;
};

}  // namespace palpate
