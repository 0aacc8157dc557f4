#pragma once

// The one place that includes GMP: integers of any size, for decisions that floating point cannot
// make.
#include <gmpxx.h>

#include "Exact/WideInteger.h"

namespace palpate {

using Integer = mpz_class;

/// value · 2^-exponent. With the least exponent of doubles, this is an integer for every finite
/// double, and zero for both zeros.
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
