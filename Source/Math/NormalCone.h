#pragma once

#include "Math/Tolerances.h"

#include <Eigen/Core>

#include <cmath>

namespace palpate {

// The normal cone of a feature has the directions in which no element at the feature comes nearer.
// The two functions below test one element. direction: unit, from the feature to the other closest
// point. bend: about the sine of an angle by which a direction may miss the element.

/// Whether a direction leads from p towards q, by more than rounding.
inline bool leadsTowards(const Eigen::Vector3d& direction, const Eigen::Vector3d& p,
                         const Eigen::Vector3d& q, double bend = 0.0) {
  const Eigen::Vector3d towards = q - p;
  return direction.dot(towards) > (kNormalConeError - bend) * towards.lpNorm<1>();
}

/// Whether a direction leads from edge pq into the triangle (p, q, r), by more than rounding. A
/// triangle without area has no inside.
inline bool leadsInto(const Eigen::Vector3d& direction, const Eigen::Vector3d& p,
                      const Eigen::Vector3d& q, const Eigen::Vector3d& r, double bend = 0.0) {
  Eigen::Vector3d along = q - p;
  const Eigen::Vector3d across = r - p;
  const double square = along.squaredNorm(), product = across.dot(along);
  double share = product / square;
  if (!(square > kSmallestEdgeSquare && std::isfinite(square) && std::isfinite(product))) {
    along = along.stableNormalized();
    share = across.dot(along);
  }
  const Eigen::Vector3d inwards = across - share * along;
  return direction.dot(inwards) >
         kNormalConeError * across.lpNorm<1>() - bend * inwards.lpNorm<1>();
}

}  // namespace palpate
