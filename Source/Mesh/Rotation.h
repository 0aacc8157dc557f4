#pragma once

#include "Mesh/Positions.h"

#include <Eigen/Core>

namespace palpate {

/// The largest magnitude among the entries of R^T R - 1; NaN for a matrix with such entries.
double deviationFromRotation(const Eigen::Matrix3d&);

/// The placement that the library uses for one that a user passes. Rotations that are off by at
/// most kOrthonormal keep their bits. Others, which came from floats, are replaced by the nearest
/// rotation, to the precision of double.
///
/// Needs    a matrix that deviates from a rotation by at most kRoughRotation. Any other is returned
///          as it is.
/// Source   Newton's iteration for the polar decomposition without inverses: Higham, Functions of
///          Matrices (2008), 8.3. The error is squared in each of three rounds.
Pose withExactRotation(const Pose&);
inline RigidMotion withExactRotations(const RigidMotion& motion) {
  return {withExactRotation(motion.before), withExactRotation(motion.now)};
}

}  // namespace palpate
