#pragma once

#include "Exact/Compensated.h"
#include "Math/Tolerances.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>

/// Lengths and angles of vectors whose squares may leave the range of double. Where they do not,
/// these have the bits of the plain formulas.
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

/// Of a vector of any length; slower.
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
  // What does not move is common.
  return v == Eigen::Vector3d::Zero() ? 0.0 : polarOfAnyLength(v).length;
}

/// Unit; zero of no length.
inline Eigen::Vector3d directionOf(const Eigen::Vector3d& v) {
  const double extent = largest(v);
  return (isModerate(extent) ? v : scaled(v, exponentTowardsOne(extent))).stableNormalized();
}

/// Of a . b, which may be anything, a number of the same sign; slower.
double signedDotOfAny(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// a . b, or where that leaves the range of double a number of the same sign.
inline double signedDot(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double product = a.dot(b);
  return isInRange(product) ? product : signedDotOfAny(a, b);
}

/// The weight in [0, 1] of the point on an axis that is nearest to `from`, both seen from the
/// axis' start. Of any vectors; slower than the quotient.
double weightOnAnyAxis(const Eigen::Vector3d& from, const Eigen::Vector3d& along);

}  // namespace palpate
