#pragma once

#include "DistanceField/FieldCells.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// Coordinates of a corner from the domain's origin, in sides of the smallest possible cell.
using Corner = std::array<std::uint32_t, 3>;

/// The corners of all cells, numbered in the order in which they are added.
class CornerTable {
 public:
  static constexpr std::uint32_t kNone = 0xffffffff;  ///< no corner, and no cell

  std::size_t size() const { return m_keys.size(); }
  Corner operator[](std::size_t i) const {
    const std::uint64_t key = m_keys[i];
    const auto coordinate = [&](int k) {
      return static_cast<std::uint32_t>(key >> k * kBits & ((1u << kBits) - 1));
    };
    return {coordinate(0), coordinate(1), coordinate(2)};
  }
  /// The number of a corner, which is added if it is new. There must be room for it.
  std::uint32_t find(const Corner& corner) {
    PALPATE_ASSERT(hasRoom(1));
    PALPATE_ASSERT(std::max({corner[0], corner[1], corner[2]}) <= kMostRoots << kMostLevels);
    const std::uint64_t key =
        corner[0] | std::uint64_t{corner[1]} << kBits | std::uint64_t{corner[2]} << 2 * kBits;
    std::uint32_t& slot = slotOf(key);
    if (slot == kNone) {
      slot = static_cast<std::uint32_t>(m_keys.size());
      m_keys.push_back(key);
    }
    return slot;
  }
  /// Whether so many corners can be added without more memory.
  bool hasRoom(std::size_t count) const { return m_keys.size() + count <= m_keys.capacity(); }
  /// Bytes that grow() allocates.
  std::size_t bytesToGrow() const { return grownSize() * (sizeof(std::uint64_t) + 2 * kSlotBytes); }
  void grow() {
    m_keys.reserve(grownSize());
    m_slots = std::vector<std::uint32_t>(2 * m_keys.capacity(), kNone);
    PALPATE_ASSERT(std::has_single_bit(m_slots.size()));
    for (std::uint32_t i = 0; i < m_keys.size(); ++i) slotOf(m_keys[i]) = i;
  }
  std::size_t capacity() const { return m_keys.capacity(); }
  std::size_t bytes() const {
    return m_keys.capacity() * sizeof(std::uint64_t) + m_slots.capacity() * kSlotBytes;
  }

 private:
  static constexpr int kBits = 21;  ///< of a coordinate
  static constexpr std::size_t kSlotBytes = sizeof(std::uint32_t);
  static_assert((std::uint64_t{kMostRoots} << kMostLevels) < 1u << kBits);

  std::size_t grownSize() const { return std::max<std::size_t>(1 << 11, 2 * m_keys.capacity()); }
  std::uint32_t& slotOf(std::uint64_t key) {
    const std::size_t mask = m_slots.size() - 1;
    std::size_t i = key * 0x9e3779b97f4a7c15u >> (64 - std::bit_width(mask));
    while (m_slots[i] != kNone && m_keys[m_slots[i]] != key) i = (i + 1) & mask;
    return m_slots[i];
  }

  std::vector<std::uint64_t> m_keys;
  std::vector<std::uint32_t> m_slots;  ///< a power of two, twice the room for keys
};

}  // namespace palpate
