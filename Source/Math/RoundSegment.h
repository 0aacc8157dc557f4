#pragma once

#include "Math/RayTriangle.h"

#include <optional>

namespace palpate {

// A segment with radii is the convex hull of the balls at its ends: the union of all balls on the
// segment whose radii are linear between those of p and q. If one end's ball holds the other's, or
// if p == q, it is that ball.

/// The weight of q at the centre of the ball that is nearest to x: the distance of x from the body
/// is that from the centre less the radius there.
///
/// Accuracy  the distance at this weight is within 2^-48 of the largest length of the least one.
double nearestBall(const Eigen::Vector3d& x, const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                   double radiusP, double radiusQ);

/// What a ray shares with a segment with radii. frontFace: the ray enters the surface at `first`.
/// crossing: 1 if it leaves the surface at `last`, else 0. Both are 0 where the ray itself begins
/// or ends inside.
///
/// Accuracy  floating point; each end within 2^-40 of the largest length, divided by the sine of
///           the angle between ray and surface.
std::optional<RayInterval> intersectRay(const RaySegment&, const Eigen::Vector3d& p,
                                        const Eigen::Vector3d& q, double radiusP, double radiusQ);

/// What a ray shares with all points within a positive radius of a triangle: one interval at most.
/// Accuracy  that of the segment's.
std::optional<RayInterval> intersectRay(const RaySegment&, const Eigen::Vector3d& a,
                                        const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                        double radius);

}  // namespace palpate
