#pragma once

#include "DistanceField/FieldCells.h"

#include <Eigen/Core>

#include <optional>
#include <span>

namespace palpate {

/// A point of an edge or a triangle.
struct DeepPoint {
  Eigen::Vector3d weights;  ///< of the corners; never negative
  double value;             ///< L: of the field, less the radius
};

/// Finds about the deepest point of an edge or a triangle: where the field less the radius is
/// least.
///
/// Shapes   corners: two or three positions in the field's frame, and their radii, which are linear
///          between them.
/// Units    L. target must be below the field's band less its error bound and all radii.
/// Returns  a point whose value is at most `target` and at most `tolerance` above the least value;
///          none only if all values are above target - tolerance.
/// Cost     follows from the number of the field's cells that the feature meets. Allocates nothing.
///
/// The feature is clipped by the cells. In a cell the field is trilinear, and along a part of the
/// feature a cubic polynomial of the weights. Its Bezier ordinates are means of the trilinear
/// function at points that mix the coordinates of the part's corners. The least ordinate bounds the
/// part's values from below. Parts whose bound is not good enough are split.
/// Source   Farin, Curves and Surfaces for CAGD (2002), 17.1: triangular Bezier patches.
std::optional<DeepPoint> findDeepPoint(const FieldLookup&, std::span<const Eigen::Vector3d> corners,
                                       std::span<const double> radii, double target,
                                       double tolerance);

}  // namespace palpate
