#pragma once

#include "Math/Tolerances.h"
#include "Exact/Predicates.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate {

/// A solid angle as a share of the whole sphere, and a bound on its error.
struct SolidAngleShare {
  double value = 0, error = 0;
  void add(const SolidAngleShare& other) { value += other.value, error += other.error; }
};

/// v with length 1; zero if v is. Faster than directionOf() of shapes, which has other last bits.
inline Eigen::Vector3d unitVector(const Eigen::Vector3d& v) {
  const double square = v.squaredNorm();
  return square > kUnderflowGuardOfProducts && square < kOverflowGuard
             ? Eigen::Vector3d(v / std::sqrt(square))
             : v.stableNormalized();
}

/// solidAngleShare() near the triangle's plane, where the sine is rounding. The side of the plane
/// is decided exactly, because the share jumps from -1/2 to 1/2 in the triangle.
[[gnu::noinline]] inline SolidAngleShare shareNearPlane(const Eigen::Vector3d& p,
                                                        const Eigen::Vector3d& a,
                                                        const Eigen::Vector3d& b,
                                                        const Eigen::Vector3d& c, double share,
                                                        double cosine, double length) {
  if (p == a || p == b || p == c) return {0, 1};
  if (cosine < 0) {
    SignCounts counts;
    const int side = orient3d(a, b, c, p, counts);
    if (side == 0) return {0, 0.5};
    share = side < 0 ? std::abs(share) : -std::abs(share);
  }
  return {share, length > 2 * kSolidAngleError ? 2 * kSolidAngleError / length : 1.0};
}

/// The share of all directions from p that a triangle covers. Positive from behind, where the
/// triangle's winding normal leads away from p.
///
/// Source   Van Oosterom and Strackee, The solid angle of a plane triangle (1983). Difference: unit
///          vectors, and a bound on the error, which grows where p is near the triangle's border.
///          The side of the triangle is decided exactly. On the triangle the share is -1/2 to 1/2.
inline SolidAngleShare solidAngleShare(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                       const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d u = unitVector(a - p), v = unitVector(b - p), w = unitVector(c - p);
  const double sine = u.dot(v.cross(w)), cosine = 1 + u.dot(v) + v.dot(w) + w.dot(u);
  const double length = std::sqrt(sine * sine + cosine * cosine);
  const double share = std::atan2(sine, cosine) / (2 * std::numbers::pi);
  if (!(std::abs(sine) > kSolidAngleError))
    return shareNearPlane(p, a, b, c, share, cosine, length);
  return {share, std::min(1.0, kSolidAngleError / length)};
}

}  // namespace palpate
