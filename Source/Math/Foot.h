#pragma once

#include "Exact/Compensated.h"

#include <Eigen/Core>

namespace palpate {

/// From the foot of a perpendicular to what it was dropped from.
struct Foot {
  Eigen::Vector3d difference, direction;  ///< direction: unit; zero where the distance is
  double distance;
  double s, t;  ///< weights of the foot in [0, 1], multiples of 2^-53
  bool exact;   ///< found, or found to touch, in integers
};

/// p seen from a.
Foot footOnPoint(const Eigen::Vector3d& p, const Eigen::Vector3d& a);
/// p seen from a + s (b - a), s in (0, 1). The same bits, s mapped, when a and b change places.
Foot footOnLine(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b);
/// p seen from a + s (b - a) + t (c - a), inside the triangle. The same bits, s and t mapped, when
/// b and c change places.
Foot footOnFace(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                const Eigen::Vector3d& c);

/// Two edges as the plane m + s u + t v of differences between their points, s and t in [-1, 1]:
/// the same bits, mapped, however edges and ends are ordered.
struct EdgePair {
  Eigen::Vector3d p0, p1, q0, q1;
  Difference m, u, v;

  EdgePair(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1, const Eigen::Vector3d& q0,
           const Eigen::Vector3d& q1);
};
/// p0 + s (p1 - p0) seen from q0 + t (q1 - q0), both inside edges that are not parallel.
Foot footBetweenEdges(const EdgePair&);

/// Unit vector along (b - a) x (d - c), zero where that is. exactDecisions: counts up where
/// floating point could not tell.
Eigen::Vector3d unitCross(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                          const Eigen::Vector3d& c, const Eigen::Vector3d& d,
                          std::size_t* exactDecisions = nullptr);

/// The coordinate axis of the least component, the first of equals.
Eigen::Vector3d axisOfLeast(const Eigen::Vector3d& extents);

}  // namespace palpate
