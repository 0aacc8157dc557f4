#pragma once

#include <palpate/Distance.h>

#include "Math/Foot.h"

/// Closest points in integer arithmetic: every sign is true of the given doubles, every value
/// within an ulp of its own. Any finite doubles. About fifty times as slow as floating point, and
/// allocates.
namespace palpate {

/// How two edges lie to each other. Interior: their lines' closest points lie strictly inside both.
/// Parallel: exactly, or one has no length.
enum class Crossing { Interior, Outside, Parallel };

}  // namespace palpate

namespace palpate::exact {

/// Sign of (p - a) . (b - a).
int along(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// Where p's projection onto the plane of (a, b, c) lies, seen from edge ab: 1 on c's side, 0 on
/// the line or the triangle has no area, -1 beyond.
int side(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
         const Eigen::Vector3d& c);

TriangleFeature closestFeature(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                               const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Whether they lie on one line; in one plane.
bool areCollinear(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);
bool areCoplanar(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                 const Eigen::Vector3d& d);

/// p seen from point a.
Foot footOnPoint(const Eigen::Vector3d& p, const Eigen::Vector3d& a);
/// Line a + s (b - a), b not a.
Foot footOnLine(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b);
/// Plane a + s (b - a) + t (c - a) of a triangle with area.
Foot footOnPlane(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                 const Eigen::Vector3d& c);

Crossing crossing(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1, const Eigen::Vector3d& q0,
                  const Eigen::Vector3d& q1);
/// The closest points p0 + s (p1 - p0), q0 + t (q1 - q0) of two lines that are not parallel.
Foot footBetweenLines(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1,
                      const Eigen::Vector3d& q0, const Eigen::Vector3d& q1);
/// Which of p0, p1 (against edge q), q0, q1 (against edge p) is nearest: 0 to 3, the first of
/// equals.
int nearestEnd(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1, const Eigen::Vector3d& q0,
               const Eigen::Vector3d& q1);

/// Unit vector along (b - a) x (d - c); zero where that is.
Eigen::Vector3d unitCross(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                          const Eigen::Vector3d& c, const Eigen::Vector3d& d);

}  // namespace palpate::exact
