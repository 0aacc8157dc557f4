// Part of Math/ImpactQuery.h: findApproach().
#include "Math/ClosestPoint.h"
#include "Math/ImpactQuery.h"
#include "Math/RelativeMotion.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate {

namespace {

using Eigen::Vector3d;
using Kind = ImpactQuery::Kind;

/// The time until which coordinate k certainly keeps the features further apart than the distance.
/// No impact is reported before it, even if features come almost as near. Callers that compare
/// boxes over part of the step may have filtered such pairs.
template <Kind kind>
double boxesSeparateUntil(const RelativeMotion<kind>& motion, int k, double distance) {
  double latest = 0.0;
  for (const double side : {1.0, -1.0}) {
    double until = 1.0;
    for (const auto& ends : motion.corner) {
      const double first = side * ends[0][k], last = side * ends[1][k];
      const double needed =
          distance + kApproachBoxError * (std::max(std::abs(first), std::abs(last)) + distance);
      if (!(first > needed))
        until = 0.0;
      else if (!(last > needed))
        until = std::min(until, (first - needed) / (first - last) * (1.0 - kQuotientError));
    }
    latest = std::max(latest, until);
  }
  return latest;
}

/// The distance at time t of the two points at which the line along A x B meets the features'
/// interiors; infinity if it does not meet both. Except for rounding, it is not below the features'
/// distance.
template <Kind kind>
double distanceInside(const RelativeMotion<kind>& motion, double t) {
  const Vector3d a = at(t, motion.a), b = at(t, motion.b), c = at(t, motion.c);
  const Vector3d normal = a.cross(b);
  const double square = normal.squaredNorm();
  const double x = c.cross(b).dot(normal) / square, y = a.cross(c).dot(normal) / square;
  const bool inside =
      x >= 0.0 && y >= 0.0 &&
      (RelativeMotion<kind>::kSquare ? x <= 1.0 && y <= 1.0 : x + y <= 1.0);  // false for NaN
  return inside ? (c - x * a - y * b).norm() : INFINITY;
}

/// The direction of the features' distance at time t, if the distance is not zero. It is within
/// 2^-50 of its length and 2^-76 of the largest difference.
template <Kind kind>
Separation accurateSeparation(const RelativeMotion<kind>& motion, double t) {
  const Vector3d zero = Vector3d::Zero(), first = at(t, motion.corner[0]);
  Separation separation;
  if constexpr (RelativeMotion<kind>::kSquare)
    separation.direction =
        -finiteEdgeEdgeDistance(zero, at(t, motion.a), first, at(t, motion.corner[2])).difference;
  else
    separation.direction = finiteVertexTriangleDistance(zero, -first, -at(t, motion.corner[1]),
                                                        -at(t, motion.corner[2]))
                               .difference;
  separation.length = separation.direction.norm();
  return separation;
}

/// Advances from time t through times at which the features are certainly further apart than the
/// distance, and reports an impact where it cannot advance.
///
/// No false negative, never late: an interval is passed only if all corners stay beyond the
/// distance along a direction, fixed or turning, or if the plane does. All errors are bounded
/// (RelativeMotion.cpp).
///
/// No false positive: at a reported time two points of the features are within reportable =
/// distance + e as computed, e = tolerance * displacement + kApproachSlack * (largest difference +
/// distance). Their distance is off by less than 2^-45 of the largest difference.
///
/// Bounded: if no such points are found, the features' distance exceeds `reportable`. The direction
/// of accurateSeparation() is right to 2^-39 at such distances. Along it, all corners are then
/// beyond the distance by more than tolerance * displacement. They take longer than the tolerance
/// to lose that margin. So each interval is longer than the tolerance, or than kShortestAdvance
/// where they are near. (Few are needed: they are Newton's steps towards the impact. Features that
/// turn as they pass each other at little more than the distance need most. There the turning
/// direction and the plane reach further.) The value of upTo does not change the steps before it.
template <Kind kind>
ImpactResult find(const RelativeMotion<kind>& motion, double distance, double tolerance, double t,
                  double upTo) {
  const Vector3d largest = motion.largestDifference();
  double displacement = 0.0;
  for (const auto& ends : motion.corner)
    displacement = std::max(displacement, (ends[1] - ends[0]).norm());
  const double reportable =
      distance + tolerance * displacement + kApproachSlack * (largest.maxCoeff() + distance);

  constexpr int kFixedDirectionIntervals = 6;  // intervals before turning directions are tried
  const double shortest = std::max(tolerance, kShortestAdvance);
  double stride = 0.0;
  Separation here = motion.bestSeparation(t);
  for (int step = 0;; ++step) {
    double separatedUntil = motion.separatedAround(t, largest, here, distance).high;
    if (!(separatedUntil == 1.0 || separatedUntil - t > shortest)) {
      if (here.nearest <= reportable || distanceInside(motion, t) <= reportable)
        return {true, false, t};
      here = accurateSeparation(motion, t);
      separatedUntil = motion.separatedAround(t, largest, here, distance).high;
      if (!(separatedUntil > t)) return {true, false, t};  // does not happen: see "Bounded" above
    }
    if (separatedUntil > upTo || separatedUntil == 1.0) return {};
    if (step >= kFixedDirectionIntervals) {
      stride = std::max(stride, 2.0 * (separatedUntil - t));
      const double ahead = std::min(t + stride, 1.0);
      const Separation there = motion.bestSeparation(ahead);
      if (motion.separatedBetween(t, here, ahead, there, largest, distance) ||
          motion.separatedByPlane(t, ahead, distance)) {
        if (ahead > upTo || ahead == 1.0) return {};
        t = ahead;
        here = there;
        stride *= 4.0;
        continue;
      }
      stride *= 0.25;
    }
    t = separatedUntil;
    here = motion.bestSeparation(t);
  }
}

/// A power of two that brings the largest difference near 1 if products of differences would
/// otherwise leave the range of doubles, else 1. Coordinates may be much larger than differences.
double scaleFor(double largest) {
  if (largest == 0.0 || (largest > kSmallestModerate && largest < kLargestModerate)) return 1.0;
  return std::ldexp(1.0, -std::clamp(std::ilogb(largest), -1000, 1000));
}

/// Differences of larger ones, such as displacements of the features, might overflow. Positions
/// times kSmaller have no larger ones.
constexpr double kLargestDifference = 0x1p1020;
constexpr double kSmaller = 0x1p-5;

template <Kind kind>
ImpactResult findScaled(const ImpactQuery& query, double distance, double tolerance, double upTo) {
  RelativeMotion<kind> motion(query);
  const Vector3d largest = motion.largestDifference();
  const auto isModerate = [&largest](int k) { return largest[k] <= kLargestDifference; };
  // Before scaling, which may lose the smallest coordinates.
  double from = 0.0;
  for (int k = 0; k < 3; ++k)
    if (isModerate(k)) from = std::max(from, boxesSeparateUntil(motion, k, distance));
  if (!(largest.maxCoeff() <= kLargestDifference)) {
    ImpactQuery smaller = query;
    for (ImpactQuery::Step& vertex : smaller.vertices)
      vertex = {kSmaller * vertex.before, kSmaller * vertex.now};
    motion = RelativeMotion<kind>(smaller);
    distance *= kSmaller;
    for (int k = 0; k < 3; ++k)
      if (!isModerate(k)) from = std::max(from, boxesSeparateUntil(motion, k, distance));
  }
  if (from > upTo || from == 1.0) return {};
  const double scale = scaleFor(motion.largestDifference().maxCoeff());
  if (scale != 1.0) motion.scale(scale);
  return find(motion, distance * scale, tolerance, from, upTo);
}

}  // namespace

ImpactResult findApproach(const ImpactQuery& query, double distance, double tolerance,
                          double upTo) {
  PALPATE_ASSERT(distance > 0.0 && tolerance >= kSmallestTimeTolerance && tolerance <= 1.0);
  return query.kind == Kind::VertexTriangle
             ? findScaled<Kind::VertexTriangle>(query, distance, tolerance, upTo)
             : findScaled<Kind::EdgeEdge>(query, distance, tolerance, upTo);
}

}  // namespace palpate
