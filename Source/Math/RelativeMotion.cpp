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

  Separation best;
  const auto consider = [&](const Vector3d& direction) {
    double least = direction.dot(corner[0]);
    for (int i = 1; i < corners; ++i) least = std::min(least, direction.dot(corner[i]));
    if (!(least > 0.0)) return;
    const double length = direction.norm();
    if (!(length > kShortestDirection)) return;
    if (least > best.distance * length) best = {direction, least / length, length};
  };
  const Vector3d a = at(t, motion.a), b = at(t, motion.b), &c = corner[0];
  const Vector3d normal = a.cross(b);
  consider(normal.dot(c) < 0.0 ? Vector3d(-normal) : normal);
  consider(awayFromSegment(c, a));
  consider(awayFromSegment(c, b));
  if constexpr (RelativeMotion<kind>::square) {
    consider(awayFromSegment(c - b, a));
    consider(awayFromSegment(c - a, b));
  } else {
    consider(awayFromSegment(c - a, b - a));
  }
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
    if (!(first > 0.0)) interval.low = std::max(interval.low, zero * (1.0 + 0x1p-50));
    if (!(last > 0.0)) interval.high = std::min(interval.high, zero * (1.0 - 0x1p-50));
  }
  return interval;
}

template Separation bestSeparation(const RelativeMotion<ImpactQuery::Kind::VertexTriangle>&,
                                   double);
template Separation bestSeparation(const RelativeMotion<ImpactQuery::Kind::EdgeEdge>&, double);
template Interval separatedAround(double, const RelativeMotion<ImpactQuery::Kind::VertexTriangle>&,
                                  const Vector3d&, const Separation&, double);
template Interval separatedAround(double, const RelativeMotion<ImpactQuery::Kind::EdgeEdge>&,
                                  const Vector3d&, const Separation&, double);

}  // namespace palpate
