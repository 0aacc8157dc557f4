#pragma once

#include "Exact/WideInteger.h"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace palpate {

/// A sum of products of three finite doubles without rounding and without heap memory. Positive and
/// negative products are summed separately. Each sum is an integer of 6,400 bits in units of
/// 2^-3222, of which every such product is a multiple. Products stay below 2^3072, so that 2^100 of
/// them fit.
/// Source   Kulisch, Computer Arithmetic and Validity (2013), 8: the long accumulator. Difference:
///          three factors; separate signs, so that no borrow runs through all words.
class ExactSum {
 public:
  void add(double x, double y, double z, bool negative = false) {
    const auto p = splitDouble(x), q = splitDouble(y), r = splitDouble(z);
    if (p.mantissa == 0 || q.mantissa == 0 || r.mantissa == 0) return;
    // The product has 159 bits in three words. Shifting it by the part of the exponent that is not
    // a whole word extends it to four words.
    const UnsignedInt128 two = UnsignedInt128{p.mantissa} * q.mantissa;
    const UnsignedInt128 low = UnsignedInt128{static_cast<std::uint64_t>(two)} * r.mantissa;
    const UnsignedInt128 high = (two >> 64) * r.mantissa + (low >> 64);
    const auto place = static_cast<unsigned>(p.exponent + q.exponent + r.exponent + kUnits);
    const auto shifted = [&](UnsignedInt128 words) {
      return UnsignedInt128{static_cast<std::uint64_t>(words)} << place % 64;
    };
    const UnsignedInt128 parts[] = {shifted(low), shifted(high), shifted(high >> 64), 0};
    Words& sum = m_words[(x < 0) ^ (y < 0) ^ (z < 0) ^ negative];
    UnsignedInt128 carry = 0;
    for (std::size_t i = 0, at = place / 64; i < 4 || carry != 0; ++i, ++at) {
      carry += sum[at];
      if (i < 4) carry += static_cast<std::uint64_t>(parts[i]);
      if (i > 0 && i < 4) carry += parts[i - 1] >> 64;
      sum[at] = static_cast<std::uint64_t>(carry);
      carry >>= 64;
    }
  }

  int sign() const {
    for (std::size_t i = kWords; i-- > 0;)
      if (m_words[0][i] != m_words[1][i]) return m_words[0][i] > m_words[1][i] ? 1 : -1;
    return 0;
  }

 private:
  static constexpr int kUnits = 3 * 1074;
  static constexpr std::size_t kWords = 100;
  using Words = std::array<std::uint64_t, kWords>;

  std::array<Words, 2> m_words{};
};

}  // namespace palpate
