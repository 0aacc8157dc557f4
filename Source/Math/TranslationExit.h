#pragma once

#include "Math/TriangleIntersection.h"

#include <Eigen/Core>

namespace palpate {

/// Where two triangles touch last while one of them moves along a line.
struct TranslationExit {
  double t;                            ///< -infinity: they never touch
  Eigen::Vector3d weightsA, weightsB;  ///< of the points that touch then
  /// Unit: the normal of b's face, of a's face turned round, or of two edges; against the motion's
  /// direction it is not negative. a leaves b along it.
  Eigen::Vector3d normal;
};

/// The largest t at which the triangle a, moved by t direction, touches b, in floating point. Pairs
/// of features whose motion is parallel to their common plane are passed over: neighbouring
/// features touch at the same t. Weights may be out of [0, 1] by kExitWeight.
///
/// Law      two triangles that intersect at one t do so until this.
TranslationExit lastTouch(const Corners& a, const Corners& b, const Eigen::Vector3d& direction);

}  // namespace palpate
