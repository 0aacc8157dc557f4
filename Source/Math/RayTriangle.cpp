#include "Math/RayTriangle.h"

#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Exact/Compensated.h"
#include "Exact/ErrorBounds.h"
#include "Exact/Rational.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace palpate {

namespace exact {
namespace {

using Eigen::Vector3d;
using Vectors = Vector<Integer>;

/// A ray and a triangle in integers of one unit, with the ray's origin at 0.
struct RayProblem {
  std::array<Vectors, 3> corners;
  Vectors direction;

  RayProblem(const RaySegment& ray, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const auto at = Integers(ray.origin, a, b, c, ray.direction).at;
    for (std::size_t i = 0; i < 3; ++i) corners[i] = at[i + 1] - at[0];
    direction = at[4];
  }
};

struct RationalInterval {
  Rational first, last;
};

bool isZero(const Vectors& a) { return a[0] == 0 && a[1] == 0 && a[2] == 0; }

/// The parameter at which the ray passes a point of its line.
Rational parameterOf(const RayProblem& problem, const Vectors& point) {
  return {dot(point, problem.direction), dot(problem.direction, problem.direction)};
}

/// What the ray's line shares with the segment from p to q, which may be a point.
std::optional<RationalInterval> onSegment(const RayProblem& problem, const Vectors& p,
                                          const Vectors& q) {
  const Vectors along = q - p, across = cross(along, problem.direction);
  if (isZero(across)) {
    if (!isZero(cross(p, problem.direction))) return {};
    Rational first = parameterOf(problem, p), last = parameterOf(problem, q);
    if (compare(last, first) < 0) std::swap(first, last);
    return RationalInterval{first, last};
  }
  if (dot(across, p) != 0) return {};
  // p + s along = t direction
  const Integer square = dot(across, across), s = -dot(cross(p, problem.direction), across);
  if (s < 0 || s > square) return {};
  const Rational t{-dot(cross(p, along), across), square};
  return RationalInterval{t, t};
}

/// What the ray's line shares with a triangle in whose plane it lies.
std::optional<RationalInterval> inPlane(const RayProblem& problem, const Vectors& normal) {
  std::array<Integer, 3> sides, along;
  for (std::size_t i = 0; i < 3; ++i) {
    sides[i] = dot(cross(problem.corners[i], problem.direction), normal);
    along[i] = dot(problem.corners[i], problem.direction);
  }
  const Integer square = dot(problem.direction, problem.direction);
  std::optional<RationalInterval> interval;
  const auto add = [&](const Rational& t) {
    if (!interval) {
      interval = {t, t};
      return;
    }
    if (compare(t, interval->first) < 0) interval->first = t;
    if (compare(t, interval->last) > 0) interval->last = t;
  };
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    if (sides[i] == 0) add({along[i], square});
    if (sgn(sides[i]) * sgn(sides[j]) < 0) {
      Rational t{sides[i] * along[j] - sides[j] * along[i], (sides[i] - sides[j]) * square};
      if (t.denominator < 0) t = {-t.numerator, -t.denominator};
      add(t);
    }
  }
  return interval;
}

/// What the ray's whole line shares with a triangle.
std::optional<RationalInterval> onLine(const RayProblem& problem) {
  const auto& [a, b, c] = problem.corners;
  const Vectors normal = cross(b - a, c - a);
  if (isZero(normal)) {
    // The longest edge holds all corners.
    std::size_t longest = 0;
    Integer most = -1;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vectors edge = problem.corners[(i + 1) % 3] - problem.corners[i];
      if (const Integer square = dot(edge, edge); square > most) {
        most = square;
        longest = i;
      }
    }
    return onSegment(problem, problem.corners[longest], problem.corners[(longest + 1) % 3]);
  }
  const Integer facing = dot(problem.direction, normal), height = dot(a, normal);
  if (facing == 0) {
    if (height != 0) return {};
    return inPlane(problem, normal);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const Integer side =
        dot(problem.direction, cross(problem.corners[i], problem.corners[(i + 1) % 3]));
    if (sgn(side) * sgn(facing) < 0) return {};
  }
  const Rational t = facing > 0 ? Rational{height, facing} : Rational{-height, -facing};
  return RationalInterval{t, t};
}

/// What the ray shares with a triangle.
std::optional<RationalInterval> intersect(const RaySegment& ray, const RayProblem& problem) {
  auto interval = onLine(problem);
  if (!interval || compare(interval->last, ray.tMin) < 0 || compare(interval->first, ray.tMax) > 0)
    return {};
  if (compare(interval->first, ray.tMin) < 0) interval->first = rational(ray.tMin);
  if (compare(interval->last, ray.tMax) > 0) interval->last = rational(ray.tMax);
  return interval;
}

/// The sign of RayInterval::crossing if the ray, moved aside, meets the triangle.
int crossingOf(const RayProblem& problem) {
  const auto& [a, b, c] = problem.corners;
  const int facing = sgn(dot(problem.direction, cross(b - a, c - a)));
  for (std::size_t i = 0; facing != 0 && i < 3; ++i) {
    const Vectors &p = problem.corners[i], &q = problem.corners[(i + 1) % 3];
    int side = sgn(dot(problem.direction, cross(p, q)));
    // Moving the origin along axis k changes the volume by component k of (p - q) x direction.
    const Vectors change = cross(p - q, problem.direction);
    for (std::size_t k = 0; side == 0 && k < 3; ++k) side = sgn(change[k]);
    if (side != facing) return 0;
  }
  return facing;
}

RayInterval intervalOf(const RayProblem& problem, const RationalInterval& interval) {
  const auto& [a, b, c] = problem.corners;
  const double first = toDouble(interval.first), last = toDouble(interval.last);
  const bool isDouble = compare(interval.first, first) == 0 && compare(interval.last, last) == 0;
  return {first, last, isDouble ? 0.0 : kRationalError * std::max(std::abs(first), std::abs(last)),
          static_cast<std::int8_t>(crossingOf(problem)),
          sgn(dot(problem.direction, cross(b - a, c - a))) < 0};
}

}  // namespace

int compareRayEnds(const RaySegment& ray, const RayEnd& one, const RayEnd& two) {
  const auto end = [&](const RayEnd& of) {
    const auto interval = intersect(ray, RayProblem(ray, of.a, of.b, of.c));
    PALPATE_ASSERT(interval);
    return of.last ? interval->last : interval->first;
  };
  return compare(end(one), end(two));
}

}  // namespace exact

namespace {

std::optional<RayInterval> intersectRayExactly(const RaySegment& ray, const Eigen::Vector3d& a,
                                               const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                               std::size_t* exactDecisions) {
  if (exactDecisions) ++*exactDecisions;
  const exact::RayProblem problem(ray, a, b, c);
  const auto interval = exact::intersect(ray, problem);
  if (!interval) return {};
  return exact::intervalOf(problem, *interval);
}

/// A product of vectors that were rounded once, and a bound on its error.
struct Volume {
  double value, error;

  /// The sign where it is certain, else 0.
  int sign() const { return (value > error) - (value < -error); }
};

/// A cross product, and the sums of its products' magnitudes.
struct CrossProduct {
  Eigen::Vector3d value, magnitude;

  CrossProduct(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      const double forward = a[j] * b[k], backward = a[k] * b[j];
      value[i] = forward - backward;
      magnitude[i] = std::abs(forward) + std::abs(backward);
    }
  }
  /// The determinant with a third vector.
  Volume volume(const Eigen::Vector3d& c) const {
    const double size = dot(magnitude, c.cwiseAbs());
    return {dot(value, c),
            kVolumeError * size + kUnderflowGuard * (1.0 + sumOfMagnitudes(c) + size)};
  }
};

}  // namespace

std::optional<RayInterval> intersectRay(const RaySegment& ray, const Eigen::Vector3d& a,
                                        const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                        std::size_t* exactDecisions) {
  PALPATE_ASSERT(!ray.direction.isZero(0.0) && ray.tMin <= ray.tMax);
  const Eigen::Vector3d p = a - ray.origin, q = b - ray.origin, r = c - ray.origin;
  // The volumes of the ray's direction with each edge, as seen from the origin.
  const CrossProduct first(ray.direction, p);
  const Volume ab = first.volume(q), ac = first.volume(r);
  const int ofAb = ab.sign(), ofCa = -ac.sign();
  if (ofAb * ofCa < 0) return {};
  const Volume bc = CrossProduct(ray.direction, q).volume(r);
  const int ofBc = bc.sign();
  if (ofAb * ofBc < 0 || ofBc * ofCa < 0) return {};
  if (ofAb == 0 || ofBc == 0 || ofCa == 0) return intersectRayExactly(ray, a, b, c, exactDecisions);
  // The direction's volume with the triangle is their sum.
  const double facing = (ab.value - ac.value) + bc.value,
               facingError =
                   (ab.error + ac.error + bc.error) * (1.0 + 0x1p-40) +
                   0x1p-51 * (std::abs(ab.value) + std::abs(ac.value) + std::abs(bc.value));
  const Volume height = CrossProduct(b - a, c - a).volume(p);
  const double t = height.value / facing;
  const double error =
      (height.error + std::abs(t) * facingError) / std::abs(facing) * (1.0 + 0x1p-40) +
      std::abs(t) * 0x1p-52;
  if (!(std::abs(facing) > facingError)) return intersectRayExactly(ray, a, b, c, exactDecisions);
  if (t + error < ray.tMin || t - error > ray.tMax) return {};
  if (!(t - error >= ray.tMin && t + error <= ray.tMax))
    return intersectRayExactly(ray, a, b, c, exactDecisions);
  return RayInterval{t, t, error, static_cast<std::int8_t>(ofAb), ofAb < 0};
}

RayPoint firstPoint(const RaySegment& ray, const RayInterval& interval, const Eigen::Vector3d& a,
                    const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                    std::size_t* exactDecisions) {
  const Eigen::Vector3d& d = ray.direction;
  const Difference p = difference(a, ray.origin), u = difference(b, a), v = difference(c, a);
  const double extent =
      std::max({largest(p.high), largest(b - ray.origin), largest(c - ray.origin)});
  const double most = kRayError * extent / largest(d), t = interval.first;
  // The step from t to the triangle's plane, by the distance of the ray's point from a.
  const Difference normals = cross(u, v);
  const Eigen::Vector3d& normal = normals.high;
  Difference left;
  for (int i = 0; i < 3; ++i) {
    const RoundedWithError along = exactProduct(d[i], t), rest = exactSum(p.high[i], -along.value);
    const RoundedWithError all = exactSum(rest.value, rest.error + (p.low[i] - along.error));
    left.high[i] = all.value;
    left.low[i] = all.error;
  }
  const double slope = dot(normal, d), step = accurateDot(normals, left) / slope;
  const double crossSize = sumOfMagnitudes(u.high) * sumOfMagnitudes(v.high);
  const double error = (kRefinedRayLoss * crossSize * sumOfMagnitudes(left.high) +
                        kRefinedRayError * std::abs(step) * crossSize * sumOfMagnitudes(d)) /
                       std::abs(slope);
  if (interval.error > 0 && isModerate(extent) && isModerate(largest(d)) &&
      isModerate(largest(normal)) && error <= most) {
    const Eigen::Vector3d onPlane = step * d - left.high;  // from a
    const double square = dot(normal, normal),
                 ofB = std::clamp(dot(onPlane.cross(v.high), normal) / square, 0.0, 1.0),
                 ofC = std::clamp(dot(u.high.cross(onPlane), normal) / square, 0.0, 1.0 - ofB);
    return {t + step, {(1.0 - ofB) - ofC, ofB, ofC}};
  }
  const auto exact =
      interval.error <= most ? interval : *intersectRayExactly(ray, a, b, c, exactDecisions);
  const Eigen::Vector3d point = ray.origin + exact.first * d;
  return {exact.first, finiteVertexTriangleDistance(point, a, b, c).weights};
}

}  // namespace palpate
