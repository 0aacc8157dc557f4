#pragma once

#include "Core/Assert.h"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace palpate {

__extension__ using Int128 = __int128;
__extension__ using UnsignedInt128 = unsigned __int128;

/// A signed integer of 256 bits in two's complement.
struct Int256 {
  UnsignedInt128 high = 0, low = 0;

  int sign() const { return static_cast<Int128>(high) < 0 ? -1 : (high | low) != 0; }
  friend Int256 operator+(const Int256& a, const Int256& b) {
    const UnsignedInt128 sum = a.low + b.low;
    return {a.high + b.high + (sum < a.low), sum};
  }
  friend Int256 operator-(const Int256& a, const Int256& b) {
    return {a.high - b.high - (a.low < b.low), a.low - b.low};
  }
};

inline Int256 product(Int128 a, Int128 b) {
  const auto magnitude = [](Int128 x) { return static_cast<UnsignedInt128>(x < 0 ? -x : x); };
  const auto low = [](UnsignedInt128 x) { return static_cast<std::uint64_t>(x); };
  const UnsignedInt128 x = magnitude(a), y = magnitude(b);
  const UnsignedInt128 ll = UnsignedInt128{low(x)} * low(y),
                       lh = UnsignedInt128{low(x)} * low(y >> 64);
  const UnsignedInt128 hl = UnsignedInt128{low(x >> 64)} * low(y),
                       hh = UnsignedInt128{low(x >> 64)} * low(y >> 64);
  const UnsignedInt128 middle = (ll >> 64) + low(lh) + low(hl);
  const Int256 result{hh + (lh >> 64) + (hl >> 64) + (middle >> 64), middle << 64 | low(ll)};
  return (a < 0) == (b < 0) ? result : Int256{} - result;
}

/// A signed integer of 512 bits in two's complement: words of 64 bits, the lowest first.
struct Int512 {
  std::array<std::uint64_t, 8> words{};

  int sign() const {
    if (words.back() >> 63) return -1;
    return std::any_of(words.begin(), words.end(), [](std::uint64_t word) { return word != 0; });
  }
  friend Int512 operator+(const Int512& a, const Int512& b) {
    Int512 sum;
    UnsignedInt128 carry = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      carry += UnsignedInt128{a.words[i]} + b.words[i];
      sum.words[i] = static_cast<std::uint64_t>(carry);
      carry >>= 64;
    }
    return sum;
  }
  friend Int512 operator-(const Int512& a, const Int512& b) {
    Int512 difference;
    UnsignedInt128 borrow = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      const UnsignedInt128 rest = UnsignedInt128{a.words[i]} - b.words[i] - borrow;
      difference.words[i] = static_cast<std::uint64_t>(rest);
      borrow = rest >> 127;
    }
    return difference;
  }
};

inline Int512 product(const Int256& a, const Int256& b) {
  const auto magnitude = [](const Int256& x) {
    const auto& [high, low] = x.sign() < 0 ? Int256{} - x : x;
    return std::array{static_cast<std::uint64_t>(low), static_cast<std::uint64_t>(low >> 64),
                      static_cast<std::uint64_t>(high), static_cast<std::uint64_t>(high >> 64)};
  };
  const auto x = magnitude(a), y = magnitude(b);
  Int512 result;
  for (std::size_t i = 0; i < 4; ++i) {
    UnsignedInt128 carry = 0;
    for (std::size_t j = 0; j < 4; ++j) {
      carry += UnsignedInt128{x[i]} * y[j] + result.words[i + j];
      result.words[i + j] = static_cast<std::uint64_t>(carry);
      carry >>= 64;
    }
    result.words[i + 4] = static_cast<std::uint64_t>(carry);
  }
  return (a.sign() < 0) == (b.sign() < 0) ? result : Int512{} - result;
}

/// |x| = mantissa 2^exponent.
struct DoubleParts {
  std::uint64_t mantissa;
  int exponent;
};
inline DoubleParts splitDouble(double x) {
  const auto bits = std::bit_cast<std::uint64_t>(x);
  const int exponent = static_cast<int>(bits >> 52 & 0x7ff);
  const std::uint64_t fraction = bits & ((std::uint64_t{1} << 52) - 1);
  if (exponent == 0) return {fraction, -1074};
  return {fraction | std::uint64_t{1} << 52, exponent - 1075};
}

/// lowest: the exponent of the largest power of two of which all coordinates are multiples.
/// highest: the exponent of a power of two above them all. Zeros are ignored.
struct ExponentRange {
  static constexpr int kNone = 2000;
  int lowest = kNone, highest = -kNone;

  template <class... Positions>
  explicit ExponentRange(const Positions&... positions) {
    for (const Eigen::Vector3d* position : {&positions...}) {
      for (const double x : *position) {
        const auto [mantissa, exponent] = splitDouble(x);
        if (mantissa == 0) continue;
        lowest = std::min(lowest, exponent + std::countr_zero(mantissa));
        highest = std::max(highest, exponent + 53);
      }
    }
  }
};

/// Positions as exact integers in units of a power of two, if their differences fit. Differences of
/// 61 bits (Coordinate = std::int64_t) are enough for meshes near each other whose coordinates do
/// not have many more bits than a double. Differences of 125 bits (Int128) also hold a gap that is
/// tiny compared to the coordinates.
template <std::size_t count, class Coordinate = std::int64_t>
struct FixedGrid {
  std::array<std::array<Coordinate, 3>, count> at;  ///< relative to the first position
  bool fits = true;

  template <class... Positions>
  explicit FixedGrid(const Positions&... positions) {
    const std::array<const Eigen::Vector3d*, count> all{&positions...};
    const auto [lowest, highest] = ExponentRange(positions...);
    fits = highest - lowest <= 120;
    for (int i = 0; i < 3 && fits; ++i) {
      const Int128 origin = integer((*all[0])[i], lowest);
      for (std::size_t n = 0; n < count; ++n) {
        const Int128 relative = integer((*all[n])[i], lowest) - origin;
        fits = fits && relative < kLimit && relative > -kLimit;
        at[n][i] = static_cast<Coordinate>(relative);
      }
    }
  }

 private:
  /// Differences of two stay below twice this.
  static constexpr Int128 kLimit = Int128{1} << (8 * sizeof(Coordinate) - 4);

  static Int128 integer(double x, int lowest) {
    const auto [mantissa, exponent] = splitDouble(x);
    if (mantissa == 0) return 0;
    const int shift = exponent - lowest;
    PALPATE_ASSERT(shift <= 67 && (shift >= 0 || mantissa >> -shift << -shift == mantissa));
    const Int128 magnitude = shift >= 0 ? Int128{mantissa} << shift : Int128{mantissa >> -shift};
    return x < 0 ? -magnitude : magnitude;
  }
};
template <class... Positions>
FixedGrid(const Positions&...) -> FixedGrid<sizeof...(Positions)>;

}  // namespace palpate
