#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>

namespace palpate {

/// Stable sort of `from` by bits [low, high) of each item into `to`, which is as long. `from` is
/// overwritten.
/// Cost     one pass over the items for each 6 bits, where there are few, to 11, where many, less one for each digit that
///          is the same in all.
inline void radixSortItems(std::span<std::uint64_t> from, std::span<std::uint64_t> to, int low,
                           int high) {
  const std::size_t size = from.size();
  std::uint64_t* const destination = to.data();
  if (size <= 32) {
    const std::uint64_t digits = ((std::uint64_t{2} << (high - low - 1)) - 1) << low;
    for (std::size_t i = 0; i < size; ++i) {
      const std::uint64_t item = from[i];
      std::size_t place = i;
      for (; place > 0 && (to[place - 1] & digits) > (item & digits); --place)
        to[place] = to[place - 1];
      to[place] = item;
    }
    return;
  }
  // The digit with the fewest steps in all: one an item and about two a bin.
  constexpr int kMostDigitBits = 11;
  constexpr std::size_t kMostCounts = std::size_t{4} << kMostDigitBits;
  int digitBits = 0, digits = 0;
  for (std::size_t bits = 6, fewest = SIZE_MAX; bits <= kMostDigitBits; ++bits) {
    const std::size_t passes = (static_cast<std::size_t>(high - low) + bits - 1) / bits,
                      steps = passes * (size + (std::size_t{2} << bits));
    if (steps >= fewest) continue;
    fewest = steps;
    digitBits = static_cast<int>(bits);
    digits = static_cast<int>(passes);
  }
  std::array<std::array<std::uint32_t, kMostCounts>, 2> counts;
  const auto bins = std::size_t{1} << digitBits;
  const std::uint64_t mask = bins - 1;
  const auto lastMask = (std::uint64_t{1} << (high - low - (digits - 1) * digitBits)) - 1;
  for (auto& half : counts) std::fill_n(half.begin(), bins * static_cast<std::size_t>(digits), 0u);
  // From both ends at once: nearly sorted items meet the same count again and again, each time
  // waiting for its last store.
  const auto count = [&](auto& half, std::uint64_t item) {
    std::uint64_t rest = item >> low;
    std::uint32_t* of = half.data();
    for (int digit = 0; digit + 1 < digits; ++digit, rest >>= digitBits, of += bins)
      ++of[rest & mask];
    ++of[rest & lastMask];
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
    std::uint32_t *begins = counts[0].data() + bins * static_cast<std::size_t>(digit),
                  *ends = counts[1].data() + bins * static_cast<std::size_t>(digit);
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

/// Stable sort of `from` by bits [low, high), at most 32, of each item into `to`, which is as long.
/// `from` is overwritten.
///
/// From frame to frame, items that are equal in these bits stay side by side: such runs are sorted
/// in place of items, where they are few.
inline void radixSort(std::span<std::uint64_t> from, std::span<std::uint64_t> to, int low,
                      int high) {
  constexpr std::size_t kMostItems = 8192, kCopied = 4;
  const std::size_t size = from.size();
  if (size <= 32 || size > kMostItems) return radixSortItems(from, to, low, high);
  const std::uint64_t mask = (std::uint64_t{2} << (high - low - 1)) - 1;
  std::array<std::uint64_t, kMostItems> runs;
  std::array<std::uint64_t, kMostItems / 2> sorted;
  // Of each run, its digits and its end.
  std::size_t count = 0;
  std::uint64_t digits = from[0] >> low & mask;
  for (std::size_t i = 1; i < size; ++i) {
    const std::uint64_t next = from[i] >> low & mask;
    runs[count] = digits << 32 | i;
    count += next != digits;
    digits = next;
  }
  runs[count++] = digits << 32 | size;
  if (std::is_sorted(runs.begin(), runs.begin() + count)) {
    std::copy(from.begin(), from.end(), to.begin());
    return;
  }
  if (count > sorted.size() || 2 * count > size) return radixSortItems(from, to, low, high);
  // Its digits, its place and its length.
  std::uint64_t place = 0;
  for (std::size_t r = 0; r < count; ++r) {
    const std::uint64_t end = runs[r] & 0xffff;
    runs[r] = (runs[r] >> 32) << 32 | place << 16 | (end - place);
    place = end;
  }
  radixSortItems({runs.data(), count}, {sorted.data(), count}, 32, 32 + high - low);
  std::size_t written = 0;
  for (std::size_t r = 0; r < count; ++r) {
    const std::size_t begin = sorted[r] >> 16 & 0xffff, length = sorted[r] & 0xffff;
    const std::size_t whole = (length + kCopied - 1) / kCopied * kCopied;
    if (std::max(begin, written) + whole <= size)  // what is too much is overwritten by the next
      for (std::size_t k = 0; k < whole; k += kCopied)
        std::memcpy(&to[written + k], &from[begin + k], kCopied * sizeof(from[0]));
    else
      std::copy_n(&from[begin], length, &to[written]);
    written += length;
  }
}

}  // namespace palpate
