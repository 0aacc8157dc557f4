#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <utility>

namespace palpate {

/// Stable sort of `from` by bits [low, high) of each item into `to`, which is as long. `from` is
/// overwritten.
/// Cost     one pass over the items for each 8 bits (6 where there are few, 11 where many), less one for each digit that is
///          the same in all.
inline void radixSort(std::span<std::uint64_t> from, std::span<std::uint64_t> to, int low,
                      int high) {
  const std::size_t size = from.size();
  std::uint64_t* const destination = to.data();
  const auto digitsOf = [=](std::uint64_t item) {
    return (item & ((std::uint64_t{2} << (high - 1)) - 1)) >> low;
  };
  // From frame to frame many ranges stay in order.
  if (std::is_sorted(from.begin(), from.end(),
                     [&](auto l, auto r) { return digitsOf(l) < digitsOf(r); })) {
    std::copy(from.begin(), from.end(), destination);
    return;
  }
  if (size <= 32) {
    for (std::size_t i = 0; i < size; ++i) {
      const std::uint64_t item = from[i];
      std::size_t place = i;
      for (; place > 0 && digitsOf(to[place - 1]) > digitsOf(item); --place)
        to[place] = to[place - 1];
      to[place] = item;
    }
    return;
  }
  const int digitBits = size < 192 ? 6 : size < 1024 ? 8 : 11;
  constexpr int kMostDigits = 6;
  std::array<std::array<std::array<std::uint32_t, 2048>, kMostDigits>, 2> counts;
  const int digits = (high - low + digitBits - 1) / digitBits;
  const auto bins = std::size_t{1} << digitBits;
  const std::uint64_t mask = bins - 1;
  const auto lastMask = (std::uint64_t{1} << (high - low - (digits - 1) * digitBits)) - 1;
  for (int digit = 0; digit < digits; ++digit)
    for (auto& half : counts) std::fill_n(half[digit].begin(), bins, 0u);
  // From both ends at once: nearly sorted items meet the same count again and again, each time
  // waiting for its last store.
  const auto count = [&](auto& half, std::uint64_t item) {
    std::uint64_t rest = item >> low;
    for (int digit = 0; digit + 1 < digits; ++digit, rest >>= digitBits) ++half[digit][rest & mask];
    ++half[digits - 1][rest & lastMask];
  };
  const std::size_t middle = size / 2;
  for (std::size_t i = 0; i < middle; ++i) {
    count(counts[0], from[i]);
    count(counts[1], from[middle + i]);
  }
  if (size & 1) count(counts[1], from[size - 1]);
  for (int digit = 0; digit < digits; ++digit) {
    const int shift = low + digit * digitBits;
    const std::uint64_t digitMask = digit + 1 == digits ? lastMask : mask;
    auto &begins = counts[0][digit], &ends = counts[1][digit];
    const std::uint64_t first = from[0] >> shift & digitMask;
    if (begins[first] + ends[first] == size) continue;
    std::uint32_t sum = 0;
    for (std::size_t bin = 0; bin <= digitMask; ++bin) {
      const std::uint32_t own = begins[bin] + ends[bin];
      begins[bin] = sum;
      ends[bin] = sum += own;
    }
    const std::uint64_t* items = from.data();
    std::uint64_t* out = to.data();
    for (std::size_t i = 0, j = size; i < middle; ++i) {
      const std::uint64_t front = items[i], back = items[--j];
      out[begins[front >> shift & digitMask]++] = front;
      out[--ends[back >> shift & digitMask]] = back;
    }
    if (size & 1) out[begins[items[middle] >> shift & digitMask]] = items[middle];
    std::swap(from, to);
  }
  if (from.data() != destination) std::copy(from.begin(), from.end(), destination);
}

}  // namespace palpate
