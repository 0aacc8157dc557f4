#pragma once

// The one place that names GMP: integers of any size, for what floating point cannot decide.
#include <gmpxx.h>

#include "Exact/WideInteger.h"

namespace palpate {

using Integer = mpz_class;

/// value · 2^-exponent: an integer for every finite double with the least exponent there is, zero
/// for both zeros.
inline Integer scaledInteger(double value, int exponent = -1074) {
  static_assert(sizeof(unsigned long) == 8);
  const auto [mantissa, own] = splitDouble(value);
  Integer integer = mantissa;
  if (own >= exponent)
    integer <<= own - exponent;
  else
    integer >>= exponent - own;
  if (value < 0) integer = -integer;
  return integer;
}

}  // namespace palpate
