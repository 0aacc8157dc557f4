#pragma once

#include "Exact/Compensated.h"

#include <Eigen/Core>

namespace palpate {

/// The foot of a perpendicular. `difference` leads from the foot to the point from which the
/// perpendicular was dropped.
struct Foot {
  Eigen::Vector3d difference, direction;  ///< direction: unit; zero if the distance is zero
  double distance;
  double s, t;  ///< weights of the foot in [0, 1], multiples of 2^-53
  bool exact;   ///< computed, or decided to touch, in integers
};

/// The foot of p on a.
Foot footOnPoint(const Eigen::Vector3d& p, const Eigen::Vector3d& a);
/// The foot of p on a + s (b - a), s in (0, 1). Swapping a and b gives the same bits, with s
/// mapped.
Foot footOnLine(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b);
/// The foot of p on a + s (b - a) + t (c - a), inside the triangle. Swapping b and c gives the same
/// bits, with s and t mapped.
Foot footOnFace(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                const Eigen::Vector3d& c);

/// Two edges as the plane m + s u + t v of differences between their points, s and t in [-1, 1].
/// Any order of the edges and of their ends gives the same bits, mapped.
struct EdgePair {
  Eigen::Vector3d p0, p1, q0, q1;
  Difference m, u, v;

  EdgePair(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1, const Eigen::Vector3d& q0,
           const Eigen::Vector3d& q1);
};
/// The foot of p0 + s (p1 - p0) on q0 + t (q1 - q0). Both points must be inside their edges, and
/// the edges must not be parallel.
Foot footBetweenEdges(const EdgePair&);

/// Unit vector along (b - a) x (d - c); zero if that product is zero. exactDecisions: incremented
/// if floating point could not decide.
Eigen::Vector3d unitCross(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                          const Eigen::Vector3d& c, const Eigen::Vector3d& d,
                          std::size_t* exactDecisions = nullptr);

/// The coordinate axis of the least component; the first one if several are equal.
Eigen::Vector3d axisOfLeastComponent(const Eigen::Vector3d& extents);

}  // namespace palpate
