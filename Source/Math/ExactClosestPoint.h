#pragma once

#include <palpate/FeaturePairs.h>

#include "Math/Foot.h"

/// Closest points in integer arithmetic. Every sign is exact for the given doubles, and every value
/// is within an ulp of the exact one. Any finite doubles are allowed. This is about fifty times as
/// slow as floating point, and allocates.
namespace palpate {

/// The relation of two edges. Interior: the closest points of their lines lie strictly inside both
/// edges. Parallel: exactly parallel, or one edge has no length.
enum class CrossingPlace { Interior, Outside, Parallel };

}  // namespace palpate

namespace palpate::exact {

/// Sign of (p - a) . (b - a).
int along(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// The side of edge ab on which p's projection onto the plane of (a, b, c) lies. 1: c's side. 0: on
/// the line, or the triangle has no area. -1: the other side.
int side(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
         const Eigen::Vector3d& c);

TriangleFeature closestFeature(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                               const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Whether the points lie on one line, or in one plane.
bool areCollinear(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);
bool areCoplanar(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                 const Eigen::Vector3d& d);

/// The foot of p on point a.
Foot footOnPoint(const Eigen::Vector3d& p, const Eigen::Vector3d& a);
/// The foot of p on the line a + s (b - a); b must differ from a.
Foot footOnLine(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b);
/// The foot of p on the plane a + s (b - a) + t (c - a) of a triangle, which must have area.
Foot footOnPlane(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                 const Eigen::Vector3d& c);

CrossingPlace crossing(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1,
                       const Eigen::Vector3d& q0, const Eigen::Vector3d& q1);
/// The closest points p0 + s (p1 - p0) and q0 + t (q1 - q0) of two lines, which must not be
/// parallel.
Foot footBetweenLines(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1,
                      const Eigen::Vector3d& q0, const Eigen::Vector3d& q1);
/// The index (0 to 3) of the nearest end: p0, p1 against edge q; q0, q1 against edge p. The first
/// one if several are equally near.
int nearestEnd(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1, const Eigen::Vector3d& q0,
               const Eigen::Vector3d& q1);

/// A triangle and the feature of it that holds the point closest to a position.
struct ClosestFeature {
  const Eigen::Vector3d &a, &b, &c;
  TriangleFeature feature;
  /// Of the corners. A face has none. An edge with radii is the hull of the balls at its ends; if
  /// they differ, the nearest ball may be at an end of it.
  Eigen::Vector3d radii = Eigen::Vector3d::Zero();
};
/// Sign of p's distance from one triangle less its distance from another.
int compareDistances(const Eigen::Vector3d& p, const ClosestFeature&, const ClosestFeature&);
/// Sign of p's distance from a triangle less a length.
int compareDistance(const Eigen::Vector3d& p, const ClosestFeature&, double length);

/// Unit vector along (b - a) x (d - c); zero if that product is zero.
Eigen::Vector3d unitCross(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                          const Eigen::Vector3d& c, const Eigen::Vector3d& d);

}  // namespace palpate::exact
