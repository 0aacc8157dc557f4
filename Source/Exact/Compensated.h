#pragma once

#include "Exact/ErrorBounds.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

/// The rounded result of an operation; value + error is the exact result.
struct RoundedWithError {
  double value, error;
};

/// The exact sum (TwoSum: Knuth, The Art of Computer Programming, volume 2, 4.2.2).
inline RoundedWithError exactSum(double a, double b) {
  const double sum = a + b, bRounded = sum - a;
  return {sum, (a - (sum - bRounded)) + (b - bRounded)};
}

/// Splits a into two halves of at most 26 bits that sum to a (Veltkamp).
inline RoundedWithError splitInHalves(double a) {
  const double scaled = 134217729.0 * a;  // 2^27 + 1
  const double high = scaled - (scaled - a);
  return {high, a - high};
}

/// The exact product (TwoProduct: Dekker, A floating-point technique for extending the available
/// precision, Numerische Mathematik 18, 1971). It uses no fused multiply-add, as the baseline
/// instruction set has none.
inline RoundedWithError exactProduct(double a, double b, const RoundedWithError& bHalves) {
  const double product = a * b;
  const auto [high, low] = splitInHalves(a);
  return {product, ((high * bHalves.value - product) + high * bHalves.error + low * bHalves.value) +
                       low * bHalves.error};
}

inline RoundedWithError exactProduct(double a, double b) {
  return exactProduct(a, b, splitInHalves(b));
}

// These add in a fixed order, whatever Eigen would choose.
inline double dot(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}
inline double sumOfMagnitudes(const Eigen::Vector3d& a) {
  return (std::abs(a[0]) + std::abs(a[1])) + std::abs(a[2]);
}
inline double largest(const Eigen::Vector3d& a) {
  return std::max({std::abs(a[0]), std::abs(a[1]), std::abs(a[2])});
}

/// Whether products of eight coordinates of this size stay within the range of double.
inline bool isModerate(double extent) {
  return extent > kSmallestModerate && extent < kLargestModerate;
}
/// The exponent of a power of two that brings an extent near 1. For zero, infinity and NaN it is
/// the limit of the exponents' range.
inline int exponentTowardsOne(double extent) {
  return extent <= std::numeric_limits<double>::max() ? -std::clamp(std::ilogb(extent), -1074, 1023)
                                                      : -1023;
}
/// A power of two that brings an extent near 1 if products might leave the range of double, else 1.
/// Its inverse is a double, too.
inline double scaleTowardsOne(double extent) {
  return isModerate(extent) ? 1.0
                            : std::ldexp(1.0, std::clamp(exponentTowardsOne(extent), -1000, 1000));
}
inline Eigen::Vector3d scaled(const Eigen::Vector3d& a, int exponent) {
  return {std::ldexp(a[0], exponent), std::ldexp(a[1], exponent), std::ldexp(a[2], exponent)};
}

/// A vector that is high + low exactly. Each component of high is the double nearest to the exact
/// value.
struct Difference {
  Eigen::Vector3d high, low;
};

/// a - b exactly.
inline Difference difference(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  Difference result;
  for (int i = 0; i < 3; ++i) {
    const auto [high, low] = exactSum(a[i], -b[i]);
    result.high[i] = high;
    result.low[i] = low;
  }
  return result;
}

/// a + b within 2^-104 of its terms. Either order gives the same bits.
inline Difference sum(const Difference& a, const Difference& b) {
  Difference result;
  for (int i = 0; i < 3; ++i) {
    const RoundedWithError high = exactSum(a.high[i], b.high[i]);
    const RoundedWithError all = exactSum(high.value, high.error + (a.low[i] + b.low[i]));
    result.high[i] = all.value;
    result.low[i] = all.error;
  }
  return result;
}

inline Difference half(const Difference& a) { return {0.5 * a.high, 0.5 * a.low}; }

/// m + s u + t v within 2^-53 of the result and 2^-78 of the terms. Swapping (s, u) and (t, v)
/// gives the same bits. s, t: at most 27 significant bits.
inline Eigen::Vector3d combination(const Difference& m, double s, const Difference& u, double t,
                                   const Difference& v) {
  Eigen::Vector3d result;
  for (int i = 0; i < 3; ++i) {
    const auto [uHigh, uLow] = splitInHalves(u.high[i]);
    const auto [vHigh, vLow] = splitInHalves(v.high[i]);
    const RoundedWithError plane = exactSum(s * uHigh, t * vHigh);
    const RoundedWithError all = exactSum(m.high[i], plane.value);
    const double rest = (s * uLow + t * vLow) + (s * u.low[i] + t * v.low[i]);
    result[i] = all.value + ((all.error + plane.error) + (m.low[i] + rest));
  }
  return result;
}

/// m + s u with the same error.
inline Eigen::Vector3d combination(const Difference& m, double s, const Difference& u) {
  Eigen::Vector3d result;
  for (int i = 0; i < 3; ++i) {
    const auto [uHigh, uLow] = splitInHalves(u.high[i]);
    const RoundedWithError all = exactSum(m.high[i], s * uHigh);
    result[i] = all.value + (all.error + (m.low[i] + (s * uLow + s * u.low[i])));
  }
  return result;
}

/// u x v within 2^-103 of |u| |v|. Swapping u and v negates the result exactly.
inline Difference cross(const Difference& u, const Difference& v) {
  Difference result;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const RoundedWithError plus = exactProduct(u.high[j], v.high[k], splitInHalves(v.high[k]));
    const RoundedWithError minus = exactProduct(u.high[k], v.high[j], splitInHalves(v.high[j]));
    const RoundedWithError high = exactSum(plus.value, -minus.value);
    const double mixed = (u.high[j] * v.low[k] + u.low[j] * v.high[k]) -
                         (u.high[k] * v.low[j] + u.low[k] * v.high[j]);
    const RoundedWithError all =
        exactSum(high.value, high.error + ((plus.error - minus.error) + mixed));
    result.high[i] = all.value;
    result.low[i] = all.error;
  }
  return result;
}

/// u x v within 2^-52 of each component and 2^-103 of |u| |v|. Swapping u and v negates the result
/// exactly.
inline Eigen::Vector3d accurateCross(const Difference& u, const Difference& v) {
  return cross(u, v).high;
}

/// u . v within 2^-53 of the result and 2^-98 of the sum of its products' magnitudes.
inline double accurateDot(const Difference& u, const Difference& v) {
  RoundedWithError all{0, 0};
  for (int i = 0; i < 3; ++i) {
    const RoundedWithError product = exactProduct(u.high[i], v.high[i]);
    const RoundedWithError sum = exactSum(all.value, product.value);
    all = {sum.value, all.error + (sum.error + (product.error +
                                                (u.high[i] * v.low[i] + u.low[i] * v.high[i])))};
  }
  return all.value + all.error;
}

}  // namespace palpate
