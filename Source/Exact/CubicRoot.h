#pragma once

#include "Exact/ErrorBounds.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate {

/// The Bernstein coefficients of a polynomial on [0, 1].
using CubicBernstein = std::array<double, 4>;
using QuadraticBernstein = std::array<double, 3>;

inline double interpolate(double l, double r, double t) { return (1.0 - t) * l + t * r; }

/// The blossom of the polynomial: the symmetric multi-affine form whose diagonal is the polynomial.
/// Computed with an error of at most 16 u times the largest coefficient's magnitude (nine
/// roundings), u = 2^-53. (Ramshaw, Blossoms are polar forms, Computer Aided Geometric Design 6,
/// 1989.)
inline double blossom(const QuadraticBernstein& b, double r, double s) {
  return interpolate(interpolate(b[0], b[1], r), interpolate(b[1], b[2], r), s);
}
inline double blossom(const CubicBernstein& b, double r, double s, double t) {
  return blossom(QuadraticBernstein{interpolate(b[0], b[1], r), interpolate(b[1], b[2], r),
                                    interpolate(b[2], b[3], r)},
                 s, t);
}

/// An approximation of the point in [low, high] at which a cubic crosses zero: upwards if rising is
/// positive, else downwards. The result is in the interval for any coefficients.
inline double approximateRoot(const CubicBernstein& b, double low, double high, int rising) {
  const QuadraticBernstein slope{3.0 * (b[1] - b[0]), 3.0 * (b[2] - b[1]), 3.0 * (b[3] - b[2])};
  PALPATE_ASSERT(low <= high && rising != 0);
  double t = 0.5 * (low + high);
  for (int i = 0; i < 64; ++i) {
    const double value = blossom(b, t, t, t);
    if (value == 0.0) return t;
    ((value > 0.0) == (rising > 0) ? high : low) = t;
    const double next = t - value / blossom(slope, t, t);
    // At a root, rounding may lead out of the interval, where bisection would begin anew.
    if (std::abs(next - t) < kRootStep) return std::clamp(next, low, high);
    t = next > low && next < high ? next : 0.5 * (low + high);
  }
  return t;
}

}  // namespace palpate
