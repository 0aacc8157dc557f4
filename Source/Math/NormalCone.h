#pragma once

#include <Eigen/Core>

#include <cmath>

namespace palpate {

/// Component of a contact's normal along a unit direction, towards which it certainly leads. A
/// normal is off by the rounding of coordinates, 2^-50 at most, over the distance that it was
/// computed from. The normals of bodies that lie flat on each other differ by no more.
constexpr double kNormalConeError = 0x1p-40;
/// L²: squared lengths above this, and products with them, lose nothing significant to underflow.
constexpr double kSmallestEdgeSquare = 0x1p-900;

// The normal cone of a feature has the directions in which no element at the feature comes nearer.
// The two functions below test one element. direction: unit, from the feature to the other closest
// point.

/// Whether a direction leads from p towards q, by more than rounding.
inline bool leadsTowards(const Eigen::Vector3d& direction, const Eigen::Vector3d& p,
                         const Eigen::Vector3d& q) {
  const Eigen::Vector3d towards = q - p;
  return direction.dot(towards) > kNormalConeError * towards.lpNorm<1>();
}

/// Whether a direction leads from edge pq into the triangle (p, q, r), by more than rounding. A
/// triangle without area has no inside.
inline bool leadsInto(const Eigen::Vector3d& direction, const Eigen::Vector3d& p,
                      const Eigen::Vector3d& q, const Eigen::Vector3d& r) {
  Eigen::Vector3d along = q - p;
  const Eigen::Vector3d across = r - p;
  const double square = along.squaredNorm(), product = across.dot(along);
  double share = product / square;
  if (!(square > kSmallestEdgeSquare && std::isfinite(product))) {
    along = along.stableNormalized();
    share = across.dot(along);
  }
  return direction.dot(across) - share * direction.dot(along) >
         kNormalConeError * across.lpNorm<1>();
}

}  // namespace palpate
