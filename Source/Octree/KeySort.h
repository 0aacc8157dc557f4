#pragma once

#include "Octree/Keys.h"
#include "Math/Box.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// Where the parts of a sorted range end, as KeySort::sortByDigits() writes them.
///
/// There is one part for each cell below the range's own cell, down to one level for each digit.
/// Parts are in the order of keys: first the cell's own elements, then the parts of octant 0, of
/// octant 1, and so on to octant 7, each in the same order. Three digits therefore have 1 + 8 * 73
/// = 585 parts.
struct PartEnds {
  static constexpr int kMaxDigits = 3;
  static constexpr std::array<std::uint32_t, kMaxDigits + 1> kCounts{1, 9, 73, 585};
};

/// One sort of keys [begin, end) by the digits that follow `level`.
struct KeyRange {
  std::uint32_t begin, end;
  int level;
  int digits = 1;              ///< number of digits to sort by
  const Cube* cube = nullptr;  ///< keys are first computed within it; null: they exist
  int levels = 0;              ///< number of levels of the computed keys
  bool first = false;          ///< no keys exist yet: they are computed for slots begin to end

  static constexpr std::size_t kFew = 255;      ///< sizes up to this: by one digit
  static constexpr std::size_t kMany = 1024;    ///< from this on: by three, as bins cost time, too
  static constexpr std::size_t kShared = 8192;  ///< from this on: by all threads
};

/// The keys of one build. They are computed and sorted range by range, in memory that the caller
/// provides.
class KeySort {
 public:
  /// `keys` and `scratch` have an element for each box. `sharedCounts` is scratch for sorts that
  /// several threads share.
  KeySort(const BoxArrays& boxes, std::span<std::uint64_t> keys, std::span<std::uint64_t> scratch,
          Buffer<std::uint32_t>& sharedCounts)
      : m_boxes(boxes), m_keys(keys), m_scratch(scratch), m_sharedCounts(sharedCounts) {}

  std::uint64_t operator[](std::size_t i) const { return m_keys[i]; }

  /// Sorts a range and writes where its parts end. If `threads` is given, they share the work.
  /// Returns 0, or, if all keys of the range have the same digits, the number of leading digits
  /// that they share. In the second case nothing is moved or written to `ends`.
  int sortByDigits(const KeyRange&, std::uint32_t* ends, const Threads* threads) const;
  /// Sorts at most KeyRange::kFew keys by one digit. Writes where the octants begin, and where the
  /// last one ends. The result goes directly to its destination, because a wide load from freshly
  /// written narrower values would stall.
  void sortByOneDigit(const KeyRange&, std::array<std::uint32_t, kChildren + 1>& begins) const;

 private:
  /// Writes the keys of a part of the range to `out`. They are computed if the range requires it,
  /// else copied.
  void loadKeys(const KeyRange&, std::size_t from, std::size_t to, std::uint64_t* out) const;

  const BoxArrays& m_boxes;
  std::span<std::uint64_t> m_keys, m_scratch;
  Buffer<std::uint32_t>& m_sharedCounts;
};

}  // namespace palpate
