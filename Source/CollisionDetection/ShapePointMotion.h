#pragma once

#include <palpate/ConstraintRows.h>

#include "Mesh/PointMotion.h"
#include "Mesh/Rotation.h"

namespace palpate {

/// The same for a shape's motion as a solver passes it.
inline Eigen::Vector3d displacementAt(const ShapeMotion& motion, const Eigen::Vector3d& point,
                                      double time) {
  return displacementAt(withExactRotation({motion.rotationBefore, motion.translationBefore}),
                        withExactRotation({motion.rotation, motion.translation}), point, time);
}

}  // namespace palpate
