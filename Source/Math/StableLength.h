#pragma once

#include <Eigen/Core>

#include <cmath>
#include <limits>

namespace palpate {

/// Length of a vector, also where the squares of its components leave the range of double.
///
/// Eigen's stableNorm() adds the squares in an order that depends on the vector's address. Here the
/// order is fixed, so that equal vectors have lengths of equal bits.
///
/// Errors   none. NaN in gives NaN out.
inline double stableLength(const Eigen::Vector3d& v) {
  const double most = v.cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
  if (most == 0.0 || !std::isfinite(most)) return most;
  constexpr double kLargest = std::numeric_limits<double>::max();
  const double inverse = 1.0 / most <= kLargest ? 1.0 / most : kLargest;
  const double scale = inverse == kLargest ? 1.0 / kLargest : most;
  const double x = v[0] * inverse, y = v[1] * inverse, z = v[2] * inverse;
  return scale * std::sqrt((x * x + y * y) + z * z);
}

/// The vector with length 1, also among denormals, where Eigen's stableNormalized() loses bits.
/// Zero if the vector is.
inline Eigen::Vector3d stableUnit(const Eigen::Vector3d& v) {
  const double most = v.cwiseAbs().maxCoeff();
  if (most == 0.0) return v;
  const Eigen::Vector3d scaled = v / most;
  return scaled /
         std::sqrt((scaled[0] * scaled[0] + scaled[1] * scaled[1]) + scaled[2] * scaled[2]);
}

}  // namespace palpate
