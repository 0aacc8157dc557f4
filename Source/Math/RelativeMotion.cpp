#include "Math/RelativeMotion.h"

#include "Math/Tolerances.h"
#include "Exact/CubicRoot.h"

#include <algorithm>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The vector to the point from its nearest point on the segment [0, segment].
Vector3d awayFromSegment(const Vector3d& point, const Vector3d& segment) {
  const double along = point.dot(segment), lengthSquared = segment.dot(segment);
  if (!(along > 0.0)) return point;
  if (along >= lengthSquared) return point - segment;
  return point - (along / lengthSquared) * segment;
}

}  // namespace

template <ImpactQuery::Kind kind>
Separation RelativeMotion<kind>::bestSeparation(double t) const {
  std::array<Vector3d, kCorners> position;
  for (int i = 0; i < kCorners; ++i) position[i] = at(t, corner[i]);

  // Squares are compared, which needs no square roots.
  Separation best;
  double bestLeast = 0.0, bestSquare = 1.0, nearestSquare = INFINITY;
  const auto consider = [&](const Vector3d& direction, double lengthSquared) {
    double least = direction.dot(position[0]);
    for (int i = 1; i < kCorners; ++i) least = std::min(least, direction.dot(position[i]));
    if (!(least > 0.0) || !(lengthSquared > kShortestDirection * kShortestDirection)) return;
    if (least * least * bestSquare > bestLeast * bestLeast * lengthSquared) {
      best.direction = direction;
      bestLeast = least;
      bestSquare = lengthSquared;
    }
  };
  const auto considerAway = [&](const Vector3d& direction) {
    const double lengthSquared = direction.squaredNorm();
    nearestSquare = std::min(nearestSquare, lengthSquared);
    consider(direction, lengthSquared);
  };
  const Vector3d u = at(t, a), v = at(t, b), &w = position[0];
  const Vector3d normal = u.cross(v);
  consider(normal.dot(w) < 0.0 ? Vector3d(-normal) : normal, normal.squaredNorm());
  considerAway(awayFromSegment(w, u));
  considerAway(awayFromSegment(w, v));
  if constexpr (kSquare) {
    considerAway(awayFromSegment(w - v, u));
    considerAway(awayFromSegment(w - u, v));
  } else {
    considerAway(awayFromSegment(w - u, v - u));
  }
  best.length = bestLeast > 0.0 ? std::sqrt(bestSquare) : 0.0;
  best.nearest = std::sqrt(nearestSquare);
  return best;
}

template <ImpactQuery::Kind kind>
Interval RelativeMotion<kind>::separatedAround(double t, const Vector3d& largest,
                                               const Separation& separation,
                                               double distance) const {
  const double error =
      kAlongError * (separation.direction.cwiseAbs().dot(largest) + distance * separation.length) +
      kImpactUnderflow;
  const double needed = distance * separation.length + error;
  Interval interval{0.0, 1.0};
  for (const auto& ends : corner) {
    const double first = separation.direction.dot(ends[0]) - needed,
                 last = separation.direction.dot(ends[1]) - needed;
    if (!(interpolate(first, last, t) > 0.0)) return {1.0, 0.0};
    // If an end is not positive, the limit is the zero in between, moved towards t by more than the
    // quotient's three roundings.
    const double zero = first / (first - last);
    if (!(first > 0.0)) interval.low = std::max(interval.low, zero * (1.0 + kQuotientError));
    if (!(last > 0.0)) interval.high = std::min(interval.high, zero * (1.0 - kQuotientError));
  }
  return interval;
}

/// A corner's coordinate along n(t) is a quadratic, and not below its least Bernstein coefficient.
/// |n(t)| is at most the larger length at the ends. The first direction separates at t0 by more
/// than kImpactUnderflow (separatedAround()), so that it is not zero, and that kAlongError of the
/// largest coordinate along it covers underflow.
template <ImpactQuery::Kind kind>
bool RelativeMotion<kind>::separatedBetween(double t0, const Separation& first, double t1,
                                            const Separation& last, const Vector3d& largest,
                                            double distance) const {
  if (!(last.length > 0.0)) return false;
  const Vector3d m = first.direction / first.length, n = last.direction / last.length;
  const double needed = distance * (1.0 + kAlongError) +
                        kAlongError * m.cwiseAbs().cwiseMax(n.cwiseAbs()).dot(largest);
  for (const auto& ends : corner) {
    const Vector3d x = at(t0, ends), y = at(t1, ends);
    if (!(m.dot(x) > needed && n.dot(y) > needed && 0.5 * (m.dot(y) + n.dot(x)) > needed))
      return false;
  }
  return true;
}

/// If the Bernstein coefficients of det(A, B, C) have one sign, |det(A, B, C)| is not below the
/// least of their magnitudes. |A x B| is at most the length of its longest coefficient.
template <ImpactQuery::Kind kind>
bool RelativeMotion<kind>::separatedByPlane(double t0, double t1, double distance) const {
  const Vector3d u = at(t0, a), v = at(t0, b), w = at(t0, c);
  const Vector3d d = at(t1, a), e = at(t1, b), f = at(t1, c);
  const Vector3d first = u.cross(v), middle = 0.5 * (u.cross(e) + d.cross(v)), last = d.cross(e);
  const auto [least, most] = std::minmax({first.dot(w), (2.0 * middle.dot(w) + first.dot(f)) / 3.0,
                                          (2.0 * middle.dot(f) + last.dot(w)) / 3.0, last.dot(f)});
  const double gap = std::max(least, -most) - kPlaneError * permanent();
  const double length = std::max({first.norm(), middle.norm(), last.norm()}) +
                        kPlaneError * largestOf(a).norm() * largestOf(b).norm();
  return gap > distance * length * (1.0 + kAlongError) + kImpactUnderflow;
}

template struct RelativeMotion<ImpactQuery::Kind::VertexTriangle>;
template struct RelativeMotion<ImpactQuery::Kind::EdgeEdge>;

}  // namespace palpate
