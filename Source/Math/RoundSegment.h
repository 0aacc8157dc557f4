#pragma once

#include "Math/RayTriangle.h"

#include <array>
#include <cstddef>
#include <optional>

namespace palpate {

/// The parts of a ray inside a segment with radii, by ascending t. They do not touch each other.
struct RoundIntervals {
  /// frontFace: the ray enters the surface at `first`. crossing: 1 if it leaves the surface at
  /// `last`, else 0. Both are 0 where the ray itself begins or ends inside.
  std::array<RayInterval, 3> intervals;
  std::size_t size = 0;
};

/// What a ray shares with a segment whose radius is p's and q's at its ends and linear between. A
/// point of space is inside if its distance to the closest point of the segment is at most the
/// radius there. p == q: a sphere.
///
/// Accuracy  floating point; each end within 2^-40 of the largest length, divided by the sine of
///           the angle between ray and surface.
RoundIntervals intersectRay(const RaySegment&, const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                            double radiusP, double radiusQ);

/// What a ray shares with all points within a positive radius of a triangle: one interval at most.
/// Accuracy  that of the segment's.
std::optional<RayInterval> intersectRay(const RaySegment&, const Eigen::Vector3d& a,
                                        const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                        double radius);

}  // namespace palpate
