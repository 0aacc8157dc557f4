#pragma once

#include <palpate/Settings.h>

#include "Octree/Keys.h"
#include "Math/Box.h"
#include "Core/Buffer.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// A k-DOP bounds a set of positions along k / 2 directions. The first three are the axes, so that
/// a box is a 6-DOP. The further directions of a 14-DOP are the diagonals of a cube, such as
/// (1, 1, -1). Those of an 18-DOP are the diagonals of its faces, such as (1, 0, -1). A direction
/// is no unit vector: its components are -1, 0 and 1.
using DopDirection = std::array<double, 3>;
constexpr int kMostDirections = 9;

int directionCount(OctreeBounds);                        ///< of k-DOPs: 7 or 9
std::span<const DopDirection> dopDirections(int count);  ///< count: 3, 7 or 9

struct OctreeNodes;

/// The bounds of an octree's elements and nodes along the directions after the axes, beside its
/// boxes.
struct OctreeDops {
  /// Eight siblings along one direction. An empty slot overlaps nothing.
  struct alignas(64) Siblings {
    float lower[kChildren], upper[kChildren];
  };

  int directions = 3;                                       ///< 3: there are none
  std::array<Buffer<float>, kMostDirections> lower, upper;  ///< of elements; padded as BoxArrays
  Buffer<Siblings> blocks;                                  ///< for each block, each direction
  std::array<double, kMostDirections> halfWidths{};         ///< means over the leaves, axes as well

  const Siblings* block(std::size_t i) const {
    return blocks.data() + i * static_cast<std::size_t>(directions - 3);
  }
  /// Of the elements' bounds: computes those of all nodes.
  void fit(const OctreeNodes&, int directions);
  std::size_t bytes() const;
};

/// Brings k-DOPs from one float frame into another, as a BoxMap does with boxes. The bound along
/// each new direction is a linear combination of three old bounds.
struct DopMap {
  /// Row k is new direction k. Its three factors are for the old directions from[k].
  struct End {
    std::uint8_t from[kMostDirections][3];
    float matrix[kMostDirections][3];
    float shiftLower[kMostDirections], shiftUpper[kMostDirections];
  };
  std::array<End, 2> ends;
  int count = 0;       ///< number of ends
  int directions = 3;  ///< rows of an end
};

/// Sets one end's map. It takes for each direction the combination that is least for the mean half
/// widths of the tree's leaves. thickness: along any unit vector. error: along an axis, as
/// forEachBodyEnd() in Bodies/OctreeFrame.cpp derives it.
///
/// Rounding. Let u be 2^-53, d a direction, and m the matrix. c = d m has components with an error
/// of 2 u sqrt(3), and their magnitudes sum up to 3 at most. Let E be three old directions, as
/// columns. The entries of its inverse are 0, or powers of two that are at most 1. The factors
/// inverse(E) c have errors of 6 u each. A position x of the boxes, none of whose coordinates
/// exceeds r, has a coordinate of at most 3 r along each old direction. The combination therefore
/// differs from c x by at most 3 * 2 sqrt(3) u r + 3 * 6 u * 3 r < 65 u r. The product d offset has
/// an error of 2 u |d|_1 times the largest coordinate of the offset, where |d|_1 is the sum of the
/// components' magnitudes. `error` exceeds what boxes need by more than both. It counts |d|_1 times
/// along d.
///
/// The conversion of the factors to float, and the arithmetic of BoxLanes::mapped(), are as for
/// boxes, relative to the bounds that the combination takes.
void setEnd(DopMap::End&, const OctreeDops&, const std::array<std::array<double, 3>, 3>& matrix,
            const std::array<double, 3>& offset, double thickness, double error);

}  // namespace palpate
