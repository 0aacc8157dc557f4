#pragma once

#include "Mesh/Positions.h"

#include <Eigen/Core>

namespace palpate {

/// L: the displacement over the step of the body's point that is at `point` at a time of the step.
/// Each point of the body moves in a straight line.
Eigen::Vector3d displacementAt(const Pose& before, const Pose& now, const Eigen::Vector3d& point,
                               double time);

}  // namespace palpate
