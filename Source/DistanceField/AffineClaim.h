#pragma once

#include "Bodies/Body.h"

#include <Eigen/Core>

#include <array>
#include <cstdint>

namespace palpate {

/// The signed distance f from a closed mesh is compared with a linear function H in a cell. It is
/// to be proven that f >= H - level (side 0) and f <= H + level (side 1). Both are one claim, for
/// (f, H) and for (-f, -H). Lengths are in the octree's floats. Docs/DistanceFields.md has the
/// proof.
struct AffineClaim {
  struct Side {
    std::array<double, 3> normal;  ///< unit: the gradient of H
    double atCentre;               ///< H at the cell's centre
    bool isWanted;
    bool needsDistance;  ///< whether H exceeds the level in the cell
    /// Whether no triangle may meet the plane H = level in the cell's shadow.
    bool needsCrossing;
  };
  std::array<double, 3> centre;  ///< of the cell
  double halfSide, level, error;
  double reach;  ///< triangles further from the centre allow the claim
  std::array<Side, 2> sides;

  /// Whether the triangles of the mesh certainly allow all sides that are wanted.
  bool holds(const Body&) const;
};

}  // namespace palpate
