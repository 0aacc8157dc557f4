#pragma once

#include "Math/Tolerances.h"
#include "Exact/Compensated.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>

/// Lengths and angles of vectors whose squares may leave the range of double. Where they do not,
/// the results have the same bits as the plain formulas.
namespace palpate {

/// Whether a square, or a dot product, neither overflowed nor lost bits to underflow.
inline bool isInRange(double product) {
  const double magnitude = std::abs(product);
  return magnitude > kUnderflowGuardOfProducts && magnitude < kOverflowGuard;
}

struct LengthAndDirection {
  double length;
  Eigen::Vector3d direction;  ///< unit; zero if the length is
};

/// polar() of a vector of any length; slower.
LengthAndDirection polarOfAnyLength(const Eigen::Vector3d&);

inline LengthAndDirection polar(const Eigen::Vector3d& v) {
  const double squared = v.squaredNorm();
  if (!isInRange(squared)) return polarOfAnyLength(v);
  const double length = std::sqrt(squared);
  return {length, v / length};
}

inline double lengthOf(const Eigen::Vector3d& v) {
  const double squared = v.squaredNorm();
  if (isInRange(squared)) return std::sqrt(squared);
  // Displacements of zero are common.
  return v == Eigen::Vector3d::Zero() ? 0.0 : polarOfAnyLength(v).length;
}

/// A unit vector; zero for a vector without length.
inline Eigen::Vector3d directionOf(const Eigen::Vector3d& v) {
  const double extent = largest(v);
  return (isModerate(extent) ? v : scaled(v, exponentTowardsOne(extent))).stableNormalized();
}

/// A number with the sign of a . b, which may leave the range of double; slower.
double signedDotOfAnyLength(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// a . b; where that leaves the range of double, a number with the same sign.
inline double signedDot(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double product = a.dot(b);
  return isInRange(product) ? product : signedDotOfAnyLength(a, b);
}

/// The weight in [0, 1] of the point on an axis that is nearest to `from`. Both vectors start at
/// the axis' start and may have any length. Slower than the plain quotient.
double weightOnAnyAxis(const Eigen::Vector3d& from, const Eigen::Vector3d& along);

}  // namespace palpate
