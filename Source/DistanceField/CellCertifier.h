#pragma once

#include "DistanceField/SurfaceSign.h"
#include "Bodies/Body.h"
#include "Octree/PointQueries.h"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <utility>

namespace palpate {

/// The corner of a cube in an octant (bit 0: x, 1: y, 2: z), from its centre.
inline Eigen::Vector3d cornerOf(std::size_t octant, double halfSide) {
  return {octant & 1 ? halfSide : -halfSide, octant & 2 ? halfSide : -halfSide,
          octant & 4 ? halfSide : -halfSide};
}

/// A cube with values at its corners, between which a field interpolates.
struct InterpolatedCell {
  Eigen::Vector3d centre;        ///< L
  double halfSide;               ///< L
  std::array<double, 8> values;  ///< L: distances from the surface
  /// Whether the values are negative inside, and the sign changes in the cell at triangles only.
  /// Otherwise they have no sign.
  bool isSigned;
  /// A triangle that is near the cell, by its place in the octree's order. Any place is valid.
  std::uint32_t nearTriangle;

  double halfDiagonal() const;  ///< L
};

/// Proves bounds on the error of trilinear interpolation of the distance from a mesh.
/// Docs/DistanceFields.md has the theorems and their proofs.
class CellCertifier {
 public:
  /// The geometry's octree must be up to date. tolerance: L; the error of distances at corners.
  CellCertifier(const Body&, const SurfaceSign&, double tolerance);

  /// Whether the interpolated distance is certainly within `bound` of the exact one in the whole
  /// cell. The values may be rounded to float; `bound` must include neither that rounding nor the
  /// tolerance.
  bool isWithin(const InterpolatedCell&, double bound, PointQueryStack&) const;
  /// Whether all points of the cell have certainly at least this distance from the surface.
  bool isBeyond(const InterpolatedCell&, double distance) const;

 private:
  std::pair<double, double> magnitudesOf(const InterpolatedCell&) const;
  bool isNearTriangle(const InterpolatedCell&, double bound) const;
  bool isPositiveInPlane(const InterpolatedCell&, const Eigen::Vector3d& normal, double atCentre,
                         double level, double error, PointQueryStack&) const;

  const Body& m_geometry;
  const SurfaceSign& m_sign;
  const double m_tolerance;  ///< L
  double m_reach;            ///< in the octree's floats: the largest coordinate
};

}  // namespace palpate
