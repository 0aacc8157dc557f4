#pragma once

#include "Exact/Compensated.h"
#include "Exact/ErrorBounds.h"

#include <Eigen/Geometry>

namespace palpate {

/// A sign as far as floating point can decide it.
enum class Sign { NotPositive, Positive, Unknown };

inline Sign signOf(double value, double error) {
  if (value > error) return Sign::Positive;
  if (value < -error) return Sign::NotPositive;
  return Sign::Unknown;  // NaN too
}

/// Sign of u . v, where u and v are differences that were rounded once.
inline Sign signAlong(const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
  const double magnitude = (std::abs(u[0] * v[0]) + std::abs(u[1] * v[1])) + std::abs(u[2] * v[2]);
  if (!(magnitude < kOverflowGuard)) return Sign::Unknown;
  const Sign sign = signOf(dot(u, v), kDotError * magnitude + kUnderflowGuard);
  if (sign != Sign::Unknown) return sign;
  // Vectors that are perpendicular axis by axis, as edges of boxes are: a product with zero has no
  // error.
  for (int i = 0; i < 3; ++i)
    if (u[i] != 0.0 && v[i] != 0.0) return Sign::Unknown;
  return Sign::NotPositive;
}

/// Sign of (edge x from) . normal. magnitude: product of the sums of magnitudes of the normal's two
/// factors.
inline Sign signAside(const Eigen::Vector3d& edge, const Eigen::Vector3d& from,
                      const Eigen::Vector3d& normal, double magnitude) {
  const double own = sumOfMagnitudes(edge) * sumOfMagnitudes(from);
  if (!(own < kSquareOverflowGuard && magnitude < kSquareOverflowGuard)) return Sign::Unknown;
  const double error = kTripleError * own * magnitude + (1.0 + own + magnitude) * kUnderflowGuard;
  return signOf(dot(edge.cross(from), normal), error);
}

}  // namespace palpate
