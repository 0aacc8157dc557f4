#include "Math/Foot.h"

#include "Math/ExactClosestPoint.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// A weight as the sum of a coarse part, a multiple of 2^-26, and a small remainder.
struct Weight {
  double coarse, fine;
};

double toCoarse(double value) { return (value + kCoarseWeight) - kCoarseWeight; }
/// Rounds to the nearest multiple of 2^-53; |value| must be below 1/4. -value gives the negated
/// result.
double toGrid(double value) { return (value + 0.75) - 0.75; }

/// The weight in [0, 1], as a multiple of 2^-53.
double unitWeight(const Weight& weight) {
  return std::clamp(weight.coarse + toGrid(weight.fine), 0.0, 1.0);
}
/// Maps a weight in [-1, 1] to [0, 1], as a multiple of 2^-53. The results for w and -w sum to 1.
double halvedWeight(const Weight& weight) {
  return std::clamp(0.5 * (1.0 + weight.coarse) + toGrid(0.5 * weight.fine), 0.0, 1.0);
}

/// Calls find(positions...) with positions scaled so that differences are near 1, and scales the
/// result back. Calls exactly(positions...) instead if scaling would lose a bit, or make positions
/// so large that their sums might overflow.
template <class Find, class Exactly, class... Positions>
Foot atModerateScale(double extent, Find&& find, Exactly&& exactly, const Positions&... positions) {
  const int exponent = exponentTowardsOne(extent);
  const auto keepsBits = [&](const Vector3d& p) {
    const Vector3d moved = scaled(p, exponent);
    return largest(moved) < kOverflowGuard && scaled(moved, -exponent) == p;
  };
  if (!(keepsBits(positions) && ...)) return exactly(positions...);
  Foot foot = find(scaled(positions, exponent)...);
  foot.difference = scaled(foot.difference, -exponent);
  foot.distance = std::ldexp(foot.distance, -exponent);
  return foot;
}

/// The vector from the middle of b to the middle of a. Swapping the ends of either gives the same
/// bits.
Difference betweenMiddles(const Vector3d& a0, const Vector3d& a1, const Vector3d& b0,
                          const Vector3d& b1) {
  return half(sum(difference(a0, -a1), difference(-b0, b1)));
}

/// The range of a foot's weights.
enum class WeightRange { ZeroToOne, MinusOneToOne };

double weightOf(const Weight& weight, WeightRange range) {
  return range == WeightRange::ZeroToOne ? unitWeight(weight) : halvedWeight(weight);
}

double extentOf(const Difference& m, const Difference& u, const Difference& v, WeightRange range) {
  const double edges = std::max(largest(u.high), largest(v.high));
  return std::max(largest(m.high), range == WeightRange::ZeroToOne ? edges : 2.0 * edges);
}

/// The foot of the perpendicular from the origin to the plane m + s u + t v. It is found by one
/// Newton step from coarse weights, whose residual is compensated. None if floating point cannot
/// decide. The distance is zero if it may be zero.
///
/// Needs    a moderate extent, from extentOf().
/// Swapping (u, s) and (v, t) gives the same bits, mapped.
std::optional<Foot> footOnPlane(const Difference& m, const Difference& u, const Difference& v,
                                WeightRange range, double extent) {
  const double square = dot(u.high, u.high) * dot(v.high, v.high);
  Vector3d normal = u.high.cross(v.high);
  double normalSquare = dot(normal, normal);
  bool accurate = false;
  const auto makeAccurate = [&] {
    normal = accurateCross(u, v);
    normalSquare = dot(normal, normal);
    accurate = true;
  };
  if (!(normalSquare > kNarrowAngleSquare * square)) makeAccurate();
  if (!(normalSquare > kSliverAngleSquare * square)) return {};
  if (!(normalSquare > kUnderflowGuardOfProducts)) return {};  // the normal of edges this short

  const auto sOf = [&](const Vector3d& from) {
    return -dot(from.cross(v.high), normal) / normalSquare;
  };
  const auto tOf = [&](const Vector3d& from) {
    return -dot(u.high.cross(from), normal) / normalSquare;
  };
  Weight s, t;
  s.coarse = toCoarse(std::clamp(sOf(m.high), -1.0, 1.0));
  t.coarse = toCoarse(std::clamp(tOf(m.high), -1.0, 1.0));
  const Vector3d residual = combination(m, s.coarse, u, t.coarse, v);

  double length = std::sqrt(normalSquare), height = dot(normal, residual) / length;
  // The plain normal is off by 5 u |u| |v| / |n| and 4 u more, u the rounding unit. The largest
  // error allowed is 7 u times the extent over the height.
  const double factors = std::sqrt(square);
  if (!accurate && !(std::abs(height) * (5.0 * factors + 4.0 * length) < 7.0 * extent * length)) {
    makeAccurate();
    length = std::sqrt(normalSquare);
    height = dot(normal, residual) / length;
  }
  const Vector3d tangential = residual - normal * (dot(normal, residual) / normalSquare);
  s.fine = sOf(tangential);
  t.fine = tOf(tangential);
  if (!(std::abs(s.fine) < kFineWeight && std::abs(t.fine) < kFineWeight)) return {};
  Foot foot{Vector3d::Zero(), Vector3d::Zero(), 0.0, weightOf(s, range), weightOf(t, range), false};
  if (!(std::abs(height) > kTouching * extent)) return foot;
  foot.direction = normal / (height < 0.0 ? -length : length);
  foot.distance = std::abs(height);
  foot.difference = foot.distance * foot.direction;
  return foot;
}

/// Whether the distance from footOnPlane() is right. It may be zero only if the four points, or the
/// ends of the two edges, lie in one plane.
bool hasRightDistance(const Foot& foot, const Vector3d& a, const Vector3d& b, const Vector3d& c,
                      const Vector3d& d) {
  return foot.distance > 0.0 || exact::areCoplanar(a, b, c, d);
}

/// Whether two vectors are exactly equal, or one is the other's opposite.
bool areEqualOrOpposite(const Difference& u, const Difference& v) {
  return (u.high == v.high && u.low == v.low) || (u.high == -v.high && u.low == -v.low);
}

}  // namespace

Foot footOnPoint(const Vector3d& p, const Vector3d& a) {
  const Vector3d difference = p - a;
  const double extent = largest(difference);
  if (extent == 0.0) return {difference, Vector3d::Zero(), 0.0, 0.0, 0.0, false};
  if (!isModerate(extent)) return atModerateScale(extent, footOnPoint, exact::footOnPoint, p, a);
  const double distance = std::sqrt(dot(difference, difference));
  return {difference, difference / distance, distance, 0.0, 0.0, false};
}

Foot footOnLine(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Difference m = betweenMiddles(p, p, a, b), edge = half(difference(b, a));
  const double extent = std::max(largest(m.high), largest(edge.high));
  if (!isModerate(extent)) return atModerateScale(extent, footOnLine, exact::footOnLine, p, a, b);
  const double square = dot(edge.high, edge.high);
  Weight weight;
  weight.coarse = toCoarse(std::clamp(dot(m.high, edge.high) / square, -1.0, 1.0));
  const Vector3d residual = combination(m, -weight.coarse, edge);
  weight.fine = dot(residual, edge.high) / square;
  // If the edge is too short to square, the weight is NaN, and this condition holds too.
  if (!(std::abs(weight.fine) < kFineWeight)) return exact::footOnLine(p, a, b);
  const Vector3d difference = residual - weight.fine * edge.high;
  if (!(largest(difference) > kTouching * extent)) {
    if (!exact::areCollinear(p, a, b)) return exact::footOnLine(p, a, b);
    return {Vector3d::Zero(), Vector3d::Zero(), 0.0, halvedWeight(weight), 0.0, true};
  }
  const double length = std::sqrt(dot(difference, difference));
  return {difference, difference / length, length, halvedWeight(weight), 0.0, false};
}

Foot footOnFace(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Difference m = difference(p, a), u = difference(a, b), v = difference(a, c);
  const double extent = extentOf(m, u, v, WeightRange::ZeroToOne);
  if (!isModerate(extent))
    return atModerateScale(extent, footOnFace, exact::footOnPlane, p, a, b, c);
  std::optional<Foot> foot = footOnPlane(m, u, v, WeightRange::ZeroToOne, extent);
  if (!foot || !hasRightDistance(*foot, p, a, b, c) || foot->s - (1.0 - foot->t) > kWeightStep)
    return exact::footOnPlane(p, a, b, c);
  foot->exact = foot->distance == 0.0;
  return *foot;
}

EdgePair::EdgePair(const Vector3d& newP0, const Vector3d& newP1, const Vector3d& newQ0,
                   const Vector3d& newQ1)
    : p0(newP0),
      p1(newP1),
      q0(newQ0),
      q1(newQ1),
      m(betweenMiddles(p0, p1, q0, q1)),
      u(half(difference(p1, p0))),
      v(half(difference(q0, q1))) {}

Foot footBetweenEdges(const EdgePair& edges) {
  const auto& [p0, p1, q0, q1, m, u, v] = edges;
  const double extent = extentOf(m, u, v, WeightRange::MinusOneToOne);
  if (!isModerate(extent)) {
    const auto find = [](const auto&... positions) {
      return footBetweenEdges(EdgePair(positions...));
    };
    return atModerateScale(extent, find, exact::footBetweenLines, p0, p1, q0, q1);
  }
  PALPATE_ASSERT(p0 != p1 && q0 != q1);
  std::optional<Foot> foot = footOnPlane(m, u, v, WeightRange::MinusOneToOne, extent);
  if (!foot || !hasRightDistance(*foot, p0, p1, q0, q1))
    return exact::footBetweenLines(p0, p1, q0, q1);
  foot->exact = foot->distance == 0.0;
  return *foot;
}

Vector3d unitCross(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d,
                   std::size_t* exactDecisions) {
  const Difference first = difference(b, a), second = difference(d, c);
  if (areEqualOrOpposite(first, second) || largest(first.high) == 0.0 ||
      largest(second.high) == 0.0)
    return Vector3d::Zero();
  const auto moderate = [](const Difference& edge) -> Difference {
    const double extent = largest(edge.high);
    if (isModerate(extent)) return edge;
    const int exponent = exponentTowardsOne(extent);
    return {scaled(edge.high, exponent), scaled(edge.low, exponent)};
  };
  const Difference u = moderate(first), v = moderate(second);
  if (isModerate(largest(u.high)) && isModerate(largest(v.high))) {
    const Vector3d normal = accurateCross(u, v);
    const double square = dot(normal, normal);
    if (square > kSliverAngleSquare * dot(u.high, u.high) * dot(v.high, v.high))
      return normal / std::sqrt(square);
  }
  if (exactDecisions) ++*exactDecisions;
  return exact::unitCross(a, b, c, d);
}

Vector3d axisOfLeastComponent(const Vector3d& extents) {
  int axis;
  extents.minCoeff(&axis);
  return Vector3d::Unit(axis);
}

}  // namespace palpate
