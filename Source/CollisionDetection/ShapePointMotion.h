#pragma once

#include <palpate/ConstraintRows.h>

namespace palpate {

/// L: the displacement over the step of the shape's point that is at `point` at a time of the step.
/// Each point of the shape moves in a straight line.
Eigen::Vector3d displacementAt(const ShapeMotion&, const Eigen::Vector3d& point, double time);

}  // namespace palpate
