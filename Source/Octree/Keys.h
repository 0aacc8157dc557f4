#pragma once

#include "Math/Box.h"

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// A cube in the float frame, a power of two wide; its lower corner and those of its cells are
/// exact in double.
struct Cube {
  std::array<double, 3> lower{};
  double edge = 0;

  Cube child(unsigned octant) const {
    const double half = edge * 0.5;
    return {{lower[0] + (octant & 1 ? half : 0), lower[1] + (octant & 2 ? half : 0),
             lower[2] + (octant & 4 ? half : 0)},
            half};
  }
};

/// Cells are not split below this: floats could not tell their children's sizes any more.
constexpr float kSmallestCell = 0x1p-100f;

/// A key within a cube: Morton code of the cell at kKeyLevels or less, then its level; so that keys
/// sorted put a cell's own primitives first and every subtree in one range.
struct KeyLayout {
  static constexpr int kMostLevels = 9;
  static constexpr int kLevelBits = 4;

  int levels;  ///< the finest, [1, kMostLevels]

  int bits() const { return 3 * levels + kLevelBits; }
  int level(std::uint32_t key) const { return static_cast<int>(key & ((1u << kLevelBits) - 1)); }
  /// The child of its cell at `level` that the key lies in.
  unsigned octant(std::uint32_t key, int level) const { return key >> octantShift(level) & 7; }
  int octantShift(int level) const { return kLevelBits + 3 * (levels - 1 - level); }
};

/// keys[i] = key << 32 | slot, for the box of each slot: level from its size, the deepest whose
/// cell edge is not shorter than its longest side (a part in a thousand is kept for rounding), and
/// cell from its centre.
/// Shapes   slots: of `boxes`, ascending; null: first, first + 1, ...
void octreeKeys(const BoxArrays& boxes, const std::uint64_t* slots, std::uint32_t first,
                std::size_t size, const Cube&, KeyLayout, std::uint64_t* keys);

}  // namespace palpate
