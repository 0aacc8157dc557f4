#pragma once

#include "Exact/ExactVector.h"
#include "Core/Assert.h"

#include <cmath>
#include <cstddef>
#include <limits>

// Integers and quotients of any size, for answers that floating point cannot give. They allocate.
namespace palpate::exact {

/// Positions as integers in units of the largest power of two of which all are multiples, so that
/// the integers are as short as possible.
template <std::size_t count>
struct Integers {
  std::array<Vector<Integer>, count> at;
  int exponent;

  template <class... Positions>
  explicit Integers(const Positions&... positions) : exponent(ExponentRange(positions...).lowest) {
    const auto integers = [&](const Eigen::Vector3d& a) -> Vector<Integer> {
      return {scaledInteger(a[0], exponent), scaledInteger(a[1], exponent),
              scaledInteger(a[2], exponent)};
    };
    at = {integers(positions)...};
  }
};
template <class... Positions>
Integers(const Positions&...) -> Integers<sizeof...(Positions)>;

inline int bits(const Integer& a) { return static_cast<int>(mpz_sizeinbase(a.get_mpz_t(), 2)); }

/// numerator 2^exponent / denominator, within an ulp; denominator must be positive.
inline double quotient(const Integer& numerator, const Integer& denominator, int exponent) {
  PALPATE_ASSERT(denominator > 0);
  if (numerator == 0) return 0.0;
  // The quotient has 64 or 65 bits and is truncated to 63, so that only one rounding to double
  // remains.
  const int shift = 64 - bits(numerator) + bits(denominator);
  const Integer magnitude = abs(numerator);
  Integer ratio = shift >= 0 ? Integer((magnitude << shift) / denominator)
                             : Integer(magnitude / (denominator << -shift));
  const int excess = bits(ratio) - 63;
  ratio >>= excess;
  const double value = std::ldexp(static_cast<double>(mpz_getlimbn(ratio.get_mpz_t(), 0)),
                                  exponent - shift + excess);
  return sgn(numerator) < 0 ? -value : value;
}

/// A quotient with a positive denominator.
struct Rational {
  Integer numerator, denominator;
};

/// The value of a finite double.
inline Rational rational(double value) {
  PALPATE_ASSERT(std::isfinite(value));
  const auto parts = splitDouble(value);
  Rational result{integer(parts.mantissa), 1};
  if (parts.exponent >= 0)
    result.numerator <<= parts.exponent;
  else
    result.denominator <<= -parts.exponent;
  if (value < 0) result.numerator = -result.numerator;
  return result;
}
inline double toDouble(const Rational& a) { return quotient(a.numerator, a.denominator, 0); }
/// Sign of a - b.
inline int compare(const Rational& a, const Rational& b) {
  PALPATE_ASSERT(a.denominator > 0 && b.denominator > 0);
  return sgn(Integer(a.numerator * b.denominator - b.numerator * a.denominator));
}
/// Sign of a - b, where b may be infinite.
inline int compare(const Rational& a, double b) {
  if (std::isinf(b)) return b > 0 ? -1 : 1;
  return compare(a, rational(b));
}

}  // namespace palpate::exact
