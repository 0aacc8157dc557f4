#pragma once

#include "Math/ImpactQuery.h"
#include "Exact/AlgebraicTime.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

// Points that move linearly, over the integers.
namespace palpate {

using Linear = std::array<Form<1>, 3>;  ///< a vector that moves linearly: its values at 0 and 1
using Quadratic = std::array<Form<2>, 3>;

/// The number odd · 2^exponent.
struct Dyadic {
  double odd = 0;
  int exponent = 0;
};

inline Dyadic dyadic(double value) {
  if (value == 0.0) return {0, std::numeric_limits<int>::max()};
  int exponent;
  const double mantissa = std::ldexp(std::frexp(value, &exponent), 53);
  const int zeros = std::countr_zero(static_cast<std::uint64_t>(std::abs(mantissa)));
  return {std::ldexp(mantissa, -zeros), exponent - 53 + zeros};
}

/// The points in units of the largest power of two of which all coordinates are multiples.
inline void toIntegers(std::span<const ImpactQuery::Step> points, std::span<Linear> motions) {
  PALPATE_ASSERT(points.size() == motions.size());
  int least = std::numeric_limits<int>::max();
  for (const ImpactQuery::Step& point : points)
    for (int end = 0; end < 2; ++end)
      for (int k = 0; k < 3; ++k) least = std::min(least, dyadic(point.at(end)[k]).exponent);
  for (std::size_t i = 0; i < points.size(); ++i)
    for (int end = 0; end < 2; ++end)
      for (int k = 0; k < 3; ++k) {
        const auto [odd, exponent] = dyadic(points[i].at(end)[k]);
        motions[i][k][end] = odd;
        if (odd != 0) motions[i][k][end] <<= exponent - least;
      }
}

inline Linear difference(const Linear& l, const Linear& r) {
  Linear result;
  for (int k = 0; k < 3; ++k)
    for (int end = 0; end < 2; ++end) result[k][end] = l[k][end] - r[k][end];
  return result;
}

inline Linear reversed(const Linear& vector) {
  const Linear zero;
  return difference(zero, vector);
}

inline Form<2> difference(Form<2> l, const Form<2>& r) {
  for (int i = 0; i < 3; ++i) l[i] -= r[i];
  return l;
}

inline void addProduct(Form<2>& sum, const Form<1>& l, const Form<1>& r) {
  sum[0] += l[0] * r[0];
  sum[1] += l[0] * r[1];
  sum[1] += l[1] * r[0];
  sum[2] += l[1] * r[1];
}

inline Form<2> crossComponent(const Linear& l, const Linear& r, int k) {
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  Form<2> component{l[i][0] * r[j][0] - l[j][0] * r[i][0], l[i][0] * r[j][1] - l[j][0] * r[i][1],
                    l[i][1] * r[j][1] - l[j][1] * r[i][1]};
  component[1] += l[i][1] * r[j][0];
  component[1] -= l[j][1] * r[i][0];
  return component;
}

/// The forms times (1-t) + t, which is 1.
inline Form<2> multiplied(const Form<1>& form) {
  return {form[0], Integer(form[0] + form[1]), form[1]};
}
inline Form<3> multiplied(const Form<2>& form) {
  return {form[0], Integer(form[0] + form[1]), Integer(form[1] + form[2]), form[2]};
}

inline Quadratic cross(const Linear& l, const Linear& r) {
  return {crossComponent(l, r, 0), crossComponent(l, r, 1), crossComponent(l, r, 2)};
}

/// With a vector that moves linearly or quadratically.
template <std::size_t N>
std::array<Integer, N + 2> dot(const Quadratic& l, const std::array<std::array<Integer, N>, 3>& r) {
  std::array<Integer, N + 2> sum;
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < N; ++j) sum[i + j] += l[k][i] * r[k][j];
  return sum;
}

/// (a x b) . c
inline Form<3> volumeOf(const Linear& a, const Linear& b, const Linear& c) {
  return dot(cross(a, b), c);
}

}  // namespace palpate
