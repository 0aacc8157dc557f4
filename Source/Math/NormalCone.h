#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace palpate {

/// Component of a contact's normal along a unit direction, towards which it certainly leads. A
/// normal is off by the rounding of coordinates, 2^-50 at most, over the distance that it was
/// computed from. The normals of bodies that lie flat on each other differ by no more.
constexpr double kNormalConeError = 0x1p-40;

// The normal cone of a feature has the directions in which no element at the feature comes nearer.
// The two functions below test one element. direction: unit, from the feature to the other closest
// point.

/// Whether a direction leads from p towards q, by more than rounding.
inline bool leadsTowards(const Eigen::Vector3d& direction, const Eigen::Vector3d& p,
                         const Eigen::Vector3d& q) {
  return direction.dot((q - p).stableNormalized()) > kNormalConeError;
}

/// Whether a direction leads from edge pq into the triangle (p, q, r), by more than rounding. A
/// triangle without area has no inside.
inline bool leadsInto(const Eigen::Vector3d& direction, const Eigen::Vector3d& p,
                      const Eigen::Vector3d& q, const Eigen::Vector3d& r) {
  const Eigen::Vector3d along = (q - p).stableNormalized(), across = (r - p).stableNormalized();
  return direction.dot(across - across.dot(along) * along) > kNormalConeError;
}

}  // namespace palpate
