#pragma once

#include "Math/Box.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate {

/// Children of a node: the octants of its cell. Keys have four bits for each level, and blocks have
/// one lane for each child, so that another number needs other keys and blocks.
inline constexpr unsigned kChildren = 8;
/// Levels of an octree at most.
inline constexpr std::size_t kMaxLevels = 61;

/// A cube in the float frame. Its edge is a power of two. Its lower corner and those of its cells
/// are exact in double.
struct Cube {
  std::array<double, 3> lower;
  double edge;

  Cube child(unsigned octant) const {
    const double half = edge * 0.5;
    return {{lower[0] + (octant & 1 ? half : 0), lower[1] + (octant & 2 ? half : 0),
             lower[2] + (octant & 4 ? half : 0)},
            half};
  }
};

/// Cells are not split below this size, as floats could not tell the sizes of their children apart.
constexpr float kSmallestCell = 0x1p-100f;

/// A key within a cube, followed by a slot. The key has four bits for each level, starting with the
/// cube's children: 8 + the octant that contains the centre, or 0 where the cells are too small for
/// the box. Sorted keys therefore put a cell's own elements first, and every subtree in one range.
/// Keys sorted by their first digits do so for the first levels.
struct Key {
  static constexpr int kLevels = 9, kDigitBits = 4, kSlotBits = 28;
  static constexpr std::uint64_t kOctant = kChildren;

  /// The `count` digits after the first `level` digits.
  static std::uint64_t digits(std::uint64_t key, int level, int count) {
    return key >> (64 - kDigitBits * (level + count)) &
           ((std::uint64_t{1} << kDigitBits * count) - 1);
  }
  static std::uint32_t slot(std::uint64_t key) {
    return static_cast<std::uint32_t>(key) & ((1u << kSlotBits) - 1);
  }
};
static_assert(2 * Key::kOctant == 1u << Key::kDigitBits);
static_assert(Key::kLevels * Key::kDigitBits + Key::kSlotBits == 64);

/// Computes keys[i] for the box of each slot. The box's level is the deepest of at most `levels`
/// whose cell edge is not shorter than the box's longest side; a thousandth of the size is kept for
/// rounding. The box's cell is the one that contains its centre.
/// Shapes   slots: keys whose slots are those of `boxes`, ascending; null: first, first + 1, ...
void octreeKeys(const BoxArrays& boxes, const std::uint64_t* slots, std::uint32_t first,
                std::size_t size, const Cube&, int levels, std::uint64_t* keys);

}  // namespace palpate
