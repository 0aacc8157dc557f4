#pragma once

#include "Math/Box.h"

#include <array>

namespace palpate {

/// Computes the shifts that bring bounds into a frame whose origin is `offset` away (in units of
/// the frame), and widen them by a thickness.
///
/// Rounding: a bound is moved by fl(lower + shift) and then outward by OutwardRounding. The shift's
/// own error is at most 2^-24 of |offset| + thickness, which is added to it here. The sum's error
/// is at most 2^-24 of the sum, which the outward step covers.
void setShift(float& lower, float& upper, double offset, double thickness);
/// The same for the three axes of boxes.
void setShift(std::array<float, 4>& lower, std::array<float, 4>& upper,
              const std::array<double, 3>& offset, double thickness);

/// Brings boxes from one float frame into another: they are turned and shifted. Two maps, for the
/// two ends of a step, give the box of both results.
///
/// Rounding. With S the sum of |m_kj| (|centre_j| + half_j), S bounds each corner's turned
/// coordinate. The errors, relative to S, are 2^-24 for the matrix' conversion to float and 2^-24
/// each for centre and half. Three products and two sums each add at most 2^-22 in all. Together
/// they are less than 2^-21; kRelative doubles that. setEnd() covers the shift's part. A box
/// clamped to float's range (kLargestFloat) may reach anywhere, so that its image is infinite. An
/// empty box gives NaN, which overlaps nothing.
struct BoxMap {
  static constexpr float kRelative = 0x1p-20f;

  struct End {
    float matrix[3][3];
    std::array<float, 4> shiftLower{}, shiftUpper{};
  };
  std::array<End, 2> ends{};
  int count = 0;  ///< number of ends; 0: boxes are unchanged

  /// Empty boxes are unchanged. BoxLanes::mapped() has the arithmetic.
  FloatBox operator()(const FloatBox&) const;
};

/// Sets one end's map. error: a bound on the error of the offset and of all positions in the boxes.
void setEnd(BoxMap::End&, const std::array<std::array<double, 3>, 3>& matrix,
            const std::array<double, 3>& offset, double thickness, double error);

}  // namespace palpate
