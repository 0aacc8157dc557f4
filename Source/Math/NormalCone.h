#pragma once

#include "Math/Tolerances.h"

#include <Eigen/Core>

#include <cmath>

namespace palpate {

// The normal cone of a feature has the directions in which no element at the feature comes nearer.
// The two functions below test one element. direction: unit, from the feature to the other closest
// point. least: component along a unit direction.

/// Whether a direction leads from p towards q, by more than rounding.
inline bool leadsTowards(const Eigen::Vector3d& direction, const Eigen::Vector3d& p,
                         const Eigen::Vector3d& q, double least = kNormalConeError) {
  const Eigen::Vector3d towards = q - p;
  return direction.dot(towards) > least * towards.lpNorm<1>();
}

/// Whether a direction leads from edge pq into the triangle (p, q, r), by more than rounding. A
/// triangle without area has no inside.
inline bool leadsInto(const Eigen::Vector3d& direction, const Eigen::Vector3d& p,
                      const Eigen::Vector3d& q, const Eigen::Vector3d& r,
                      double least = kNormalConeError) {
  Eigen::Vector3d along = q - p;
  const Eigen::Vector3d across = r - p;
  const double square = along.squaredNorm(), product = across.dot(along);
  double share = product / square;
  if (!(square > kSmallestEdgeSquare && std::isfinite(product))) {
    along = along.stableNormalized();
    share = across.dot(along);
  }
  return direction.dot(across) - share * direction.dot(along) > least * across.lpNorm<1>();
}

}  // namespace palpate
