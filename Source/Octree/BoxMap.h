#pragma once

#include "Math/Box.h"

#include <array>
#include <cmath>

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

  FloatBox operator()(const FloatBox& box) const {
    if (count == 0 || box.empty()) return box;
    FloatBox all;
    for (int i = 0; i < count; ++i) all.add(at(ends[i], box));
    return all;
  }

 private:
  static FloatBox at(const End& end, const FloatBox& box) {
    FloatBox turned;
    float farthest = 0;
    for (int j = 0; j < 3; ++j) farthest = std::max({farthest, -box.lower[j], box.upper[j]});
    for (int k = 0; k < 3; ++k) {
      float centre = 0, half = 0, size = 0;
      for (int j = 0; j < 3; ++j) {
        const float c = (box.lower[j] + box.upper[j]) * 0.5f,
                    h = (box.upper[j] - box.lower[j]) * 0.5f, m = end.matrix[k][j];
        centre = centre + m * c;
        half = half + std::fabs(m) * h;
        size = size + std::fabs(m) * (std::fabs(c) + h);
      }
      half = half + (size * kRelative + OutwardRounding::kAbsolute);
      if (farthest >= kLargestFloat) half = std::numeric_limits<float>::infinity();
      turned.lower[k] = OutwardRounding::down(centre - half + end.shiftLower[k]);
      turned.upper[k] = OutwardRounding::up(centre + half + end.shiftUpper[k]);
    }
    return turned;
  }
};

}  // namespace palpate
