#include "Octree/KeySort.h"

#include "Core/Assert.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>
#include <type_traits>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/KeySort.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

// No vectors are used here. Shifts by a variable take a third of the time on newer processors.

/// Calls f(bin, i, length) for each run of consecutive keys in one bin. Most keys stay in such runs
/// from frame to frame. Counting a whole run at once avoids waiting for the last store to the same
/// count.
template <class F>
HWY_INLINE HWY_ATTR void forRuns(const std::uint64_t* keys, std::size_t size, int shift,
                                 std::size_t bins, F&& f) {
  constexpr std::size_t kRun = 8;
  const std::size_t mask = bins - 1;
  std::size_t i = 0;
  for (; i + kRun <= size; i += kRun) {
    std::uint64_t differ = 0;
    for (std::size_t k = 1; k < kRun; ++k) differ |= keys[i] ^ keys[i + k];
    if ((differ >> shift & mask) == 0) {
      f(keys[i] >> shift & mask, i, std::integral_constant<std::size_t, kRun>());
    } else {
      for (std::size_t k = i; k < i + kRun; ++k)
        f(keys[k] >> shift & mask, k, std::integral_constant<std::size_t, 1>());
    }
  }
  for (; i < size; ++i) f(keys[i] >> shift & mask, i, std::integral_constant<std::size_t, 1>());
}

/// Counts the keys of each bin. Returns the bits in which any two keys differ.
HWY_ATTR std::uint64_t countKeysKernel(const std::uint64_t* keys, std::size_t size, int shift,
                                       std::size_t bins, std::uint32_t* counts) {
  forRuns(keys, size, shift, bins, [=](std::size_t bin, std::size_t, auto length) {
    counts[bin] += static_cast<std::uint32_t>(length());
  });
  std::uint64_t differ = 0;
  for (std::size_t i = 1; i < size; ++i) differ |= keys[0] ^ keys[i];
  return differ;
}

/// Writes keys to the places of their bins.
HWY_ATTR void scatterKeysKernel(const std::uint64_t* keys, std::size_t size, int shift,
                                std::size_t bins, std::uint32_t* places, std::uint64_t* out) {
  forRuns(keys, size, shift, bins, [=](std::size_t bin, std::size_t i, auto length) {
    std::memcpy(out + places[bin], keys + i, length() * sizeof(*out));
    places[bin] += static_cast<std::uint32_t>(length());
  });
}

/// Sorts at most 255 keys by one digit. Returns where the octants begin, one byte each.
HWY_ATTR std::uint64_t sortFewKeysKernel(const std::uint64_t* keys, std::size_t size, int shift,
                                         std::uint64_t* out) {
  // Eight counts in the bytes of one integer, so that no count waits for its last store.
  constexpr std::uint64_t kOnes = 0x0101010101010101;
  const auto one = [](std::uint64_t digit) {
    return digit / Key::kOctant << digit % Key::kOctant * 8;
  };
  std::uint64_t counts = 0;
  for (std::size_t i = 0; i < size; ++i) counts += one(keys[i] >> shift & 15);
  const std::uint64_t own = size - (counts * kOnes >> 56);
  const std::uint64_t begins = own * kOnes + (counts * kOnes << 8);
  std::uint64_t places = begins, ownPlace = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const std::uint64_t digit = keys[i] >> shift & 15;
    if (HWY_UNLIKELY(digit < Key::kOctant)) {
      out[ownPlace++] = keys[i];
    } else {
      out[places >> digit % Key::kOctant * 8 & 0xff] = keys[i];
      places += one(digit);
    }
  }
  return begins;
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(countKeysKernel);
HWY_EXPORT(scatterKeysKernel);
HWY_EXPORT(sortFewKeysKernel);

namespace {

/// Calls f(bin) for each bin that keys of so many digits can have, ascending.
template <int digits, class F>
void forBins(unsigned before, F&& f) {
  f(before << Key::kDigitBits * digits);
  if constexpr (digits > 0)
    for (unsigned octant = 0; octant < kChildren; ++octant)
      forBins<digits - 1>(before << Key::kDigitBits | Key::kOctant | octant, f);
}

template <class F>
void forBins(int digits, F&& f) {
  if (digits == 1) return forBins<1>(0, f);
  if (digits == 2) return forBins<2>(0, f);
  forBins<3>(0, f);
}

int shiftOf(int level, int digits) { return 64 - Key::kDigitBits * (level + digits); }

}  // namespace

void KeySort::loadKeys(const KeyRange& range, std::size_t from, std::size_t to,
                       std::uint64_t* out) const {
  const std::uint64_t* keys = m_keys.data() + range.begin + from;
  if (range.cube)
    octreeKeys(m_boxes, range.first ? nullptr : keys, static_cast<std::uint32_t>(from), to - from,
               *range.cube, range.levels, out);
  else
    std::copy_n(keys, to - from, out);
}

int KeySort::sortByDigits(const KeyRange& range, std::uint32_t* ends,
                          const Threads* threads) const {
  const std::size_t size = range.end - range.begin,
                    bins = std::size_t{1} << Key::kDigitBits * range.digits;
  PALPATE_ASSERT(range.digits >= 1 && range.digits <= PartEnds::kMaxDigits);
  PALPATE_ASSERT(range.begin < range.end && range.end <= m_keys.size());
  // One part for each thread; the sorted order does not depend on the number of parts.
  const bool shared = threads && threads->count() > 1 && size >= KeyRange::kShared;
  const std::size_t wanted = shared ? static_cast<std::size_t>(threads->count()) : 1,
                    grain = (size + wanted - 1) / wanted, parts = (size + grain - 1) / grain;
  // 16 KB on the stack. No function called from here sorts, so they exist only once at a time.
  std::array<std::uint32_t, 1 << Key::kDigitBits * PartEnds::kMaxDigits> ownCounts;
  if (shared) m_sharedCounts.resize(bins * parts);
  std::uint32_t* counts = shared ? m_sharedCounts.data() : ownCounts.data();
  std::uint64_t* scratch = m_scratch.data() + range.begin;
  const int shift = shiftOf(range.level, range.digits);
  const auto forChunks = [&](auto&& f) {
    if (shared) return threads->forChunks(size, grain, f);
    f(std::size_t{0}, std::size_t{0}, size);
  };
  std::atomic<std::uint64_t> differ = 0;
  forChunks([&](std::size_t chunk, std::size_t from, std::size_t to) {
    loadKeys(range, from, to, scratch + from);
    std::uint32_t* own = counts + chunk * bins;
    std::fill_n(own, bins, 0u);
    differ |= HWY_DYNAMIC_DISPATCH(countKeysKernel)(scratch + from, to - from, shift, bins, own);
  });
  for (std::size_t i = 0; i < size; i += grain) differ |= scratch[0] ^ scratch[i];
  const int equalDigits = std::min(std::countl_zero(differ.load()) / Key::kDigitBits, Key::kLevels);
  if (equalDigits >= range.level + range.digits) {
    std::copy_n(scratch, range.cube ? size : 0, m_keys.data() + range.begin);
    return equalDigits;
  }
  std::uint32_t sum = range.begin;
  forBins(range.digits, [&](std::size_t bin) {
    for (std::size_t part = 0; part < parts; ++part)
      sum += std::exchange(counts[part * bins + bin], sum);
  });
  forChunks([&](std::size_t chunk, std::size_t from, std::size_t to) {
    HWY_DYNAMIC_DISPATCH(scatterKeysKernel)
    (scratch + from, to - from, shift, bins, counts + chunk * bins, m_keys.data());
  });
  // Each bin ends where the last thread's part of it ends.
  const std::uint32_t* last = counts + (parts - 1) * bins;
  forBins(range.digits, [&](std::size_t bin) { *ends++ = last[bin]; });
  return 0;
}

void KeySort::sortByOneDigit(const KeyRange& range,
                             std::array<std::uint32_t, kChildren + 1>& begins) const {
  const std::size_t size = range.end - range.begin;
  PALPATE_ASSERT(range.digits == 1 && size <= KeyRange::kFew);
  std::array<std::uint64_t, KeyRange::kFew> keys;
  loadKeys(range, 0, size, keys.data());
  const std::uint64_t places = HWY_DYNAMIC_DISPATCH(sortFewKeysKernel)(
      keys.data(), size, shiftOf(range.level, 1), m_keys.data() + range.begin);
  for (unsigned octant = 0; octant < kChildren; ++octant)
    begins[octant] = range.begin + (places >> 8 * octant & 0xff);
  begins[kChildren] = range.end;
}

}  // namespace palpate
#endif
