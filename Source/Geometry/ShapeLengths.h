#pragma once

#include "Math/Compensated.h"
#include "Math/Tolerances.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
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

inline LengthAndDirection polar(const Eigen::Vector3d& v) {
  const double squared = v.squaredNorm();
  if (isInRange(squared)) {
    const double length = std::sqrt(squared);
    return {length, v / length};
  }
  const int exponent = exponentTowardsOne(largest(v));
  const Eigen::Vector3d near = scaled(v, exponent);
  const double length = near.norm();
  if (!(length > 0.0)) return {0.0, Eigen::Vector3d::Zero()};
  return {std::ldexp(length, -exponent), near / length};
}

inline double lengthOf(const Eigen::Vector3d& v) {
  const double squared = v.squaredNorm();
  return isInRange(squared) ? std::sqrt(squared) : polar(v).length;
}

/// Unit; zero of no length.
inline Eigen::Vector3d directionOf(const Eigen::Vector3d& v) {
  const double extent = largest(v);
  return (isModerate(extent) ? v : scaled(v, exponentTowardsOne(extent))).stableNormalized();
}

/// a . b, or where that leaves the range of double a number of the same sign.
inline double signedDot(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double product = a.dot(b);
  if (isInRange(product)) return product;
  const double ofA = largest(a), ofB = largest(b);
  if (ofA == 0.0 || ofB == 0.0) return 0.0;
  return scaled(a, exponentTowardsOne(ofA)).dot(scaled(b, exponentTowardsOne(ofB)));
}

/// The weight in [0, 1] of the point on an axis that is nearest to `from`, both seen from the
/// axis' start; 0 where the axis has no length.
inline double weightOnAxis(const Eigen::Vector3d& from, const Eigen::Vector3d& along) {
  double square = along.squaredNorm(), product = from.dot(along);
  if (!(isInRange(square) && std::abs(product) < kOverflowGuard)) {
    if (along == Eigen::Vector3d::Zero()) return 0.0;
    const int exponent = exponentTowardsOne(std::max(largest(from), largest(along)));
    const Eigen::Vector3d nearAlong = scaled(along, exponent);
    square = nearAlong.squaredNorm();
    product = scaled(from, exponent).dot(nearAlong);
    if (!(square > 0.0)) return 0.0;  // then it is a point beside the distance
  }
  return std::clamp(product / square, 0.0, 1.0);
}

}  // namespace palpate
