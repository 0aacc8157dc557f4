#pragma once

// The one place that includes GMP: integers of any size, for decisions that floating point cannot
// make.
#include <gmpxx.h>

#include "Exact/WideInteger.h"

namespace palpate {

using Integer = mpz_class;

/// GMP takes a `long`, which has 32 bits on Windows.
inline Integer integer(std::uint64_t value) {
  if constexpr (sizeof(unsigned long) == 8) return static_cast<unsigned long>(value);
  Integer result = static_cast<unsigned long>(value >> 32);
  result <<= 32;
  result += static_cast<unsigned long>(value & 0xffffffff);
  return result;
}

/// value · 2^-exponent. With the least exponent of doubles, this is an integer for every finite
/// double, and zero for both zeros.
inline Integer scaledInteger(double value, int exponent = -1074) {
  const auto [mantissa, own] = splitDouble(value);
  Integer scaled = integer(mantissa);
  if (own >= exponent)
    scaled <<= own - exponent;
  else
    scaled >>= exponent - own;
  if (value < 0) scaled = -scaled;
  return scaled;
}

}  // namespace palpate
