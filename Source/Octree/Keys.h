#pragma once

#include "Math/Box.h"

#include <array>
#include <cstdint>

namespace palpate {

/// A cube in the float frame, a power of two wide; its lower corner and those of its cells are
/// exact in double.
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

/// Cells are not split below this: floats could not tell their children's sizes any more.
constexpr float kSmallestCell = 0x1p-100f;

/// A key within a cube, and behind it a slot. Four bits for each level from the cube's children
/// down: 8 + the octant that the centre lies in, or 0 where cells are too small. So keys sorted put
/// a cell's own elements first and every subtree in one range, and keys sorted by their first
/// digits do so for the first levels.
struct Key {
  static constexpr int kMostLevels = 9, kDigitBits = 4, kSlotBits = 28;
  static constexpr std::uint64_t kOctant = 8;

  /// The digits after the first `level`, as many as asked for.
  static std::uint64_t digits(std::uint64_t key, int level, int count) {
    return key >> (64 - kDigitBits * (level + count)) &
           ((std::uint64_t{1} << kDigitBits * count) - 1);
  }
  static std::uint32_t slot(std::uint64_t key) {
    return static_cast<std::uint32_t>(key) & ((1u << kSlotBits) - 1);
  }
};

/// keys[i], for the box of each slot: level from its size, the deepest of at most `levels` whose
/// cell edge is not shorter than its longest side (a part in a thousand is kept for rounding), and
/// cell from its centre.
/// Shapes   slots: keys whose slots are those of `boxes`, ascending; null: first, first + 1, ...
void octreeKeys(const BoxArrays& boxes, const std::uint64_t* slots, std::uint32_t first,
                std::size_t size, const Cube&, int levels, std::uint64_t* keys);

}  // namespace palpate
