#pragma once

#include "Math/Box.h"

#include <array>

namespace palpate {

/// Shifts for the bounds of boxes between frames whose origins are `offset` apart (in units of the
/// frame), and a thickness.
///
/// Rounding: a bound is moved by fl(lower + shift) and then outward by OutwardRounding. The shift's
/// own error is at most 2^-24 of |offset| + thickness, which is added to it here; the sum's is at
/// most 2^-24 of the sum, which the outward step covers.
void setShift(std::array<float, 4>& lower, std::array<float, 4>& upper,
              const std::array<double, 3>& offset, double thickness);

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

/// One end's map. error: of the offset and of all positions that are in the boxes.
void setEnd(BoxMap::End&, const std::array<std::array<double, 3>, 3>& matrix,
            const std::array<double, 3>& offset, double thickness, double error);

}  // namespace palpate
