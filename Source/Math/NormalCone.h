#pragma once

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Core>

#include <cmath>

namespace palpate {

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
  if (!(square > kSmallestEdgeSquare && std::isfinite(square) && std::isfinite(product))) {
    along = along.stableNormalized();
    share = across.dot(along);
  }
  return direction.dot(across) - share * direction.dot(along) >
         kNormalConeError * across.lpNorm<1>();
}

/// The plane that touches a body at a contact's point, at the end of a step.
///
/// Law      if the other body stays in front of the plane by a gap, it stays away by that gap, less
///          slack, from everything in the plane.
struct TangentPlane {
  Eigen::Vector3d up;  ///< unit, from the body towards the other one
  double height;       ///< L: of the body's surface, along `up`
  double gap;          ///< L: of the other body from the plane, as the contact's row has it
  double slack;        ///< L

  /// point: the contact's, on the centre line of the body's surface, which is `radius` away.
  TangentPlane(const Eigen::Vector3d& normal, const Eigen::Vector3d& point, double radius,
               double gapAtEnd, double thickness)
      : up(normal),
        height(normal.dot(point) + radius),
        gap(gapAtEnd),
        slack(kPlaneShare * thickness + kNormalConeError * (point.lpNorm<1>() + radius)) {
    PALPATE_ASSERT(radius >= 0.0 && thickness >= 0.0);
  }

  /// Whether a ball of the body touches the plane from behind.
  bool touches(const Eigen::Vector3d& centre, double radius) const {
    return std::abs(up.dot(centre) + radius - height) <= slackAt(centre);
  }
  /// Whether a contact with the other plane is with this one, too.
  bool isSameAs(const TangentPlane& other) const {
    return (up - other.up).norm() <= kNormalConeError &&
           std::abs(height - other.height) <= slack + other.slack;
  }
  /// Whether a ball of the other body is in front of the plane by the gap.
  bool hasInFront(const Eigen::Vector3d& centre, double radius) const {
    return up.dot(centre) - radius >= height + gap - slackAt(centre);
  }

 private:
  double slackAt(const Eigen::Vector3d& x) const {
    return slack + kNormalConeError * x.lpNorm<1>();
  }
};

}  // namespace palpate
