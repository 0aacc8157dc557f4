#pragma once

#include "Core/Buffer.h"
#include "Core/Threads.h"
#include "Math/Box.h"
#include "Octree/Keys.h"

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// Where the parts of a sorted range end, as KeySort::byDigits() writes them.
///
/// Parts are those of the cells below the range's own, down to one level for each digit. They come
/// in the order of keys: first the cell's own elements, then the parts of octant 0, of octant 1,
/// and so on to octant 7, each in the same order. So parts of 3 digits are 1 + 8 * 73 = 585.
struct PartEnds {
  static constexpr int kMostDigits = 3;
  static constexpr std::array<std::uint32_t, kMostDigits + 1> kCounts{1, 9, 73, 585};
};

/// One sort: of keys [begin, end), by the digits that follow `level`.
struct KeyRange {
  std::uint32_t begin, end;
  int level;
  int digits = 1;              ///< that the range is sorted by
  const Cube* cube = nullptr;  ///< the keys are first computed in this; null: they are there
  int levels = 0;              ///< that the computed keys have
  bool first = false;          ///< no keys are there yet: they are computed for slots begin to end

  static constexpr std::size_t kFew = 255;      ///< up to here by one digit
  static constexpr std::size_t kMany = 1024;    ///< from here on by three: bins take time, too
  static constexpr std::size_t kShared = 8192;  ///< from here on by all threads
};

/// The keys of one build. They are computed and sorted range by range, in the memory given.
class KeySort {
 public:
  /// `keys` and `scratch` have an element for each box. `sharedCounts` is scratch of sorts that
  /// threads share.
  KeySort(const BoxArrays& boxes, std::span<std::uint64_t> keys, std::span<std::uint64_t> scratch,
          Buffer<std::uint32_t>& sharedCounts)
      : m_boxes(boxes), m_keys(keys), m_scratch(scratch), m_sharedCounts(sharedCounts) {}

  std::uint64_t operator[](std::size_t i) const { return m_keys[i]; }

  /// Sorts a range and writes where its parts end. With `threads` they share the work.
  /// Returns 0; or, where all keys of the range have the same digits, the number of first digits
  /// that they have in common: then nothing is moved or written to `ends`.
  int byDigits(const KeyRange&, std::uint32_t* ends, const Threads* threads) const;
  /// Sorts at most KeyRange::kFew keys by one digit. Writes where the octants begin, and the end:
  /// to their place, as a load that spans fresh narrower stores waits for them.
  void byOneDigit(const KeyRange&, std::array<std::uint32_t, 9>& begins) const;

 private:
  /// Writes the keys of a part of the range, which are computed where it says so.
  void takeKeys(const KeyRange&, std::size_t from, std::size_t to, std::uint64_t* out) const;

  const BoxArrays& m_boxes;
  std::span<std::uint64_t> m_keys, m_scratch;
  Buffer<std::uint32_t>& m_sharedCounts;
};

}  // namespace palpate
