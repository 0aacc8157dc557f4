#pragma once

#include <palpate/DistanceField.h>

#include "DistanceField/CellCertifier.h"
#include "DistanceField/CornerTable.h"
#include "DistanceField/FieldCells.h"
#include "DistanceField/SurfaceSign.h"
#include "Mesh/TriangleMesh.h"

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// Where a field is, and how small its error is to be.
struct FieldDomain {
  FieldCells empty;       ///< the field without cells
  Eigen::Vector3d lower;  ///< L: the corner with the least coordinates
  double unit;            ///< L
  double tolerance;       ///< L: the error of distances at corners
  double bound;           ///< L: the error bound without what rounding may add

  /// Throws InvalidSettings if the lengths are too small or too large.
  FieldDomain(const TriangleMesh&, const SurfaceSign&, const DistanceFieldSettings&);

  Eigen::Vector3d positionOf(const Corner& corner) const {
    return lower +
           std::ldexp(unit, -kMostLevels) * Eigen::Vector3d(corner[0], corner[1], corner[2]);
  }
  double halfSideOf(int level) const { return std::ldexp(0.5 * unit, -level); }
};

/// A cell of a field that is built.
struct TreeCell {
  enum class State : std::uint8_t {
    Split,
    Certified,
    Beyond,   ///< the band
    Adjusted  ///< beyond the band, with corner values, because it touches a larger cell with such
  };
  std::array<std::uint32_t, 8> corners;
  std::uint32_t children = CornerTable::kNone;  ///< the first of eight
  float allowed = 0;  ///< units: the deviation of corners up to which the bound is proven
  std::uint8_t level = 0;
  State state = State::Split;
  bool isOff = false;           ///< the deviation of its corners is larger than allowed
  bool isReliable = false;      ///< the sign in all of it; otherwise its values have none
  bool isUnreliable = false;    ///< the sign in all of it
  bool isSplitForSign = false;  ///< only some of its points may have a reliable sign

  bool hasChildren() const { return children != CornerTable::kNone; }
  bool isLeaf() const { return state == State::Certified || state == State::Adjusted; }
  /// Whether its neighbours have the same values where they meet.
  bool isJoined() const { return isLeaf() && isReliable; }
};

/// The cells of a field that is built, and what is known at their corners. New cells and corners
/// come after all others. A phase of the build fills the columns of those that are new.
struct CellTree {
  static constexpr std::uint32_t kNone = CornerTable::kNone;

  const FieldDomain& domain;
  const std::size_t memoryLimit;  ///< bytes; 0: none
  std::vector<TreeCell> cells;    ///< the roots come first
  CornerTable corners;
  // Of each corner:
  std::vector<std::uint32_t> parents;  ///< the cell whose split made it, or kNone
  std::vector<std::uint8_t> covered;   ///< octants in which it is the corner of a cell, as bits
  std::vector<float> distances;        ///< units
  std::vector<std::uint8_t> hasSign;   ///< of the distance: a reliable cell has this corner
  std::vector<std::uint32_t> nearest;  ///< the nearest triangle, by its place in the octree
  std::vector<float> values;           ///< units: what the cells interpolate
  std::vector<std::uint32_t> owners;   ///< the cell on which it hangs, or kNone

  /// Makes the root cells. memoryLimit: bytes; 0: none. It throws MemoryLimit, as split() does.
  CellTree(const FieldDomain&, std::size_t memoryLimit);

  /// Splits a leaf. The signs of its children are known where its own is.
  void split(std::uint32_t cell);

  /// The largest cell with values that the corner touches other than with a corner, or kNone. The
  /// corner hangs on it, unless its values have no sign.
  std::uint32_t largestAround(std::uint32_t corner) const;
  Eigen::Vector3d positionOf(std::uint32_t corner) const {
    return domain.positionOf(corners[corner]);
  }
  /// Of a column, with a sign if that of the cell is reliable.
  static float valueAt(const TreeCell& cell, std::size_t corner, const std::vector<float>& column) {
    const float value = column[cell.corners[corner]];
    return cell.isReliable ? value : std::abs(value);
  }
  /// Between the distances at the corners.
  InterpolatedCell interpolated(const TreeCell&) const;
  /// Units: between the values, at a corner of other cells.
  double interpolate(const TreeCell&, const Corner&) const;

  std::size_t bytesUsed() const;
  /// Throws MemoryLimit if the build may not allocate so many bytes.
  void checkMemory(std::size_t more) const;

 private:
  std::uint32_t cornerAt(const Corner&, std::uint32_t parent);
  void addCell(const std::array<std::uint32_t, 8>& corners, const TreeCell* parent);
  void makeRoom();
  std::uint32_t leafAround(const Corner&, std::uint32_t octant) const;
};

}  // namespace palpate
