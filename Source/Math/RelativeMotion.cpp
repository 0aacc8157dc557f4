#include "Math/RelativeMotion.h"

#include "Math/CubicRoot.h"
#include "Math/Tolerances.h"

#include <algorithm>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The vector from its nearest point on the segment [0, segment] to the point.
Vector3d awayFromSegment(const Vector3d& point, const Vector3d& segment) {
  const double along = point.dot(segment), lengthSquared = segment.dot(segment);
  if (!(along > 0.0)) return point;
  if (along >= lengthSquared) return point - segment;
  return point - (along / lengthSquared) * segment;
}

}  // namespace

template <ImpactQuery::Kind kind>
Separation bestSeparation(const RelativeMotion<kind>& motion, double t) {
  constexpr int corners = RelativeMotion<kind>::corners;
  std::array<Vector3d, corners> corner;
  for (int i = 0; i < corners; ++i) corner[i] = at(t, motion.corner[i]);

  // Compared squared: no root for each.
  Separation best;
  double bestLeast = 0.0, bestSquare = 1.0, nearestSquare = INFINITY;
  const auto consider = [&](const Vector3d& direction, double square) {
    double least = direction.dot(corner[0]);
    for (int i = 1; i < corners; ++i) least = std::min(least, direction.dot(corner[i]));
    if (!(least > 0.0) || !(square > kShortestDirection * kShortestDirection)) return;
    if (least * least * bestSquare > bestLeast * bestLeast * square) {
      best.direction = direction;
      bestLeast = least;
      bestSquare = square;
    }
  };
  const auto considerAway = [&](const Vector3d& direction) {
    const double square = direction.squaredNorm();
    nearestSquare = std::min(nearestSquare, square);
    consider(direction, square);
  };
  const Vector3d a = at(t, motion.a), b = at(t, motion.b), &c = corner[0];
  const Vector3d normal = a.cross(b);
  consider(normal.dot(c) < 0.0 ? Vector3d(-normal) : normal, normal.squaredNorm());
  considerAway(awayFromSegment(c, a));
  considerAway(awayFromSegment(c, b));
  if constexpr (RelativeMotion<kind>::square) {
    considerAway(awayFromSegment(c - b, a));
    considerAway(awayFromSegment(c - a, b));
  } else {
    considerAway(awayFromSegment(c - a, b - a));
  }
  best.length = bestLeast > 0.0 ? std::sqrt(bestSquare) : 0.0;
  best.nearest = std::sqrt(nearestSquare);
  return best;
}

template <ImpactQuery::Kind kind>
Interval separatedAround(double t, const RelativeMotion<kind>& motion, const Vector3d& largest,
                         const Separation& separation, double distance) {
  const double error =
      kAlongError * (separation.direction.cwiseAbs().dot(largest) + distance * separation.length) +
      kImpactUnderflow;
  const double needed = distance * separation.length + error;
  Interval interval{0.0, 1.0};
  for (const auto& ends : motion.corner) {
    const double first = separation.direction.dot(ends[0]) - needed,
                 last = separation.direction.dot(ends[1]) - needed;
    if (!(between(first, last, t) > 0.0)) return {1.0, 0.0};
    // Where the end itself is not positive the limit is the zero between, moved towards t by more
    // than the quotient's three roundings.
    const double zero = first / (first - last);
    if (!(first > 0.0)) interval.low = std::max(interval.low, zero * (1.0 + kQuotientError));
    if (!(last > 0.0)) interval.high = std::min(interval.high, zero * (1.0 - kQuotientError));
  }
  return interval;
}

/// Along n(t) a corner moves as a quadratic, above its Bernstein coefficients; |n(t)| is at most
/// the larger length at the ends.
template <ImpactQuery::Kind kind>
bool separatedBetween(double t0, const Separation& first, double t1, const Separation& last,
                      const RelativeMotion<kind>& motion, const Vector3d& largest,
                      double distance) {
  if (!(first.length > 0.0 && last.length > 0.0)) return false;
  const Vector3d m = first.direction / first.length, n = last.direction / last.length;
  const double needed = distance * (1.0 + kAlongError) +
                        kAlongError * m.cwiseAbs().cwiseMax(n.cwiseAbs()).dot(largest) +
                        kImpactUnderflow;
  for (const auto& ends : motion.corner) {
    const Vector3d x = at(t0, ends), y = at(t1, ends);
    if (!(m.dot(x) > needed && n.dot(y) > needed && 0.5 * (m.dot(y) + n.dot(x)) > needed))
      return false;
  }
  return true;
}

/// |det(A, B, C)| is above its Bernstein coefficients of one sign, |A x B| below the longest of
/// its.
template <ImpactQuery::Kind kind>
bool separatedByPlane(double t0, double t1, const RelativeMotion<kind>& motion, double distance) {
  const Vector3d a = at(t0, motion.a), b = at(t0, motion.b), c = at(t0, motion.c);
  const Vector3d d = at(t1, motion.a), e = at(t1, motion.b), f = at(t1, motion.c);
  const Vector3d first = a.cross(b), middle = 0.5 * (a.cross(e) + d.cross(b)), last = d.cross(e);
  const auto [least, most] = std::minmax({first.dot(c), (2.0 * middle.dot(c) + first.dot(f)) / 3.0,
                                          (2.0 * middle.dot(f) + last.dot(c)) / 3.0, last.dot(f)});
  const double gap = std::max(least, -most) - kPlaneError * permanent(motion);
  const double length = std::max({first.norm(), middle.norm(), last.norm()}) +
                        kPlaneError * largestOf(motion.a).norm() * largestOf(motion.b).norm();
  return gap > distance * length * (1.0 + kAlongError) + kImpactUnderflow;
}

template Separation bestSeparation(const RelativeMotion<ImpactQuery::Kind::VertexTriangle>&,
                                   double);
template Separation bestSeparation(const RelativeMotion<ImpactQuery::Kind::EdgeEdge>&, double);
template Interval separatedAround(double, const RelativeMotion<ImpactQuery::Kind::VertexTriangle>&,
                                  const Vector3d&, const Separation&, double);
template Interval separatedAround(double, const RelativeMotion<ImpactQuery::Kind::EdgeEdge>&,
                                  const Vector3d&, const Separation&, double);
template bool separatedBetween(double, const Separation&, double, const Separation&,
                               const RelativeMotion<ImpactQuery::Kind::VertexTriangle>&,
                               const Vector3d&, double);
template bool separatedBetween(double, const Separation&, double, const Separation&,
                               const RelativeMotion<ImpactQuery::Kind::EdgeEdge>&, const Vector3d&,
                               double);

template bool separatedByPlane(double, double,
                               const RelativeMotion<ImpactQuery::Kind::VertexTriangle>&, double);
template bool separatedByPlane(double, double, const RelativeMotion<ImpactQuery::Kind::EdgeEdge>&,
                               double);

}  // namespace palpate
