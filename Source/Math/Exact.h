#pragma once

// The one place that names GMP: integers of any size, for what floating point cannot decide.
#include <gmpxx.h>

#include <bit>
#include <cstdint>

namespace palpate {

using Integer = mpz_class;

/// value · 2^1074: an integer for every finite double, zero for both zeros.
inline Integer scaledInteger(double value) {
  static_assert(sizeof(unsigned long) == 8);
  const auto bits = std::bit_cast<std::uint64_t>(value);
  const unsigned exponent = bits >> 52 & 0x7ff;
  const std::uint64_t fraction = bits & ((std::uint64_t{1} << 52) - 1);
  Integer integer = exponent == 0 ? fraction : fraction | std::uint64_t{1} << 52;
  integer <<= exponent == 0 ? 0 : exponent - 1;
  if (bits >> 63) integer = -integer;
  return integer;
}

}  // namespace palpate
