#include "Math/RoundSegment.h"

#include "Math/Foot.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Exact/Compensated.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct Range {
  double first, last;
};

/// Calls f(range) for the parts of `within` in which a t² + 2 b t + c is at most 0.
template <class F>
void forEachBelow(double a, double b, double c, const Range& within, F&& f) {
  const auto add = [&](double first, double last) {
    const Range part{std::max(first, within.first), std::min(last, within.last)};
    if (part.first <= part.last) f(part);
  };
  if (a == 0.0) {
    if (b == 0.0) {
      if (c <= 0.0) add(-kInfinite, kInfinite);
    } else if (b > 0.0) {
      add(-kInfinite, -c / (2 * b));
    } else {
      add(-c / (2 * b), kInfinite);
    }
    return;
  }
  const double discriminant = b * b - a * c;
  if (discriminant < 0.0) {
    if (a < 0.0) add(-kInfinite, kInfinite);
    return;
  }
  const double sum = -(b + std::copysign(std::sqrt(discriminant), b));
  double first = sum / a, last = sum != 0.0 ? c / sum : first;
  if (first > last) std::swap(first, last);
  if (a > 0.0) return add(first, last);
  add(-kInfinite, first);
  add(last, kInfinite);
}

}  // namespace

double nearestBall(const Eigen::Vector3d& x, const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                   double radiusP, double radiusQ) {
  PALPATE_ASSERT(radiusP >= 0.0 && radiusQ >= 0.0);
  const double scale =
      scaleTowardsOne(std::max({largest(x - p), largest(q - p), radiusP, radiusQ}));
  const Eigen::Vector3d m = scale * (x - p), u = scale * (q - p);
  const double length = u.norm(), change = scale * (radiusQ - radiusP);
  const double room = (length - change) * (length + change);
  if (!(room > 0.0)) return change > 0.0 ? 1.0 : 0.0;
  // The nearest ball's centre is a multiple of the height beyond the foot of x, towards the larger
  // end: the line from it to x is perpendicular to the cone.
  const double height = m.cross(u).norm() / length;
  return std::clamp((m.dot(u) / length + height * (change / std::sqrt(room))) / length, 0.0, 1.0);
}

namespace {

/// Calls f(range) for the parts of a line that are in the cone between two balls, neither of which
/// is in the other.
/// direction: of the line, of length 1. m: from the ball at p to the line's start. u: from p to q.
template <class F>
void forEachInCone(const Eigen::Vector3d& direction, const Eigen::Vector3d& m,
                   const Eigen::Vector3d& u, double radiusP, double radiusQ, F&& f) {
  // At the place w along the axis the cone's radius is (radiusP + taper w) / cosine. It touches
  // the balls where w is -taper times their radii from their centres.
  const double axis = u.norm(), change = radiusQ - radiusP;
  const Eigen::Vector3d e = u / axis;
  const double taper = change / axis,
               squareOfCosine = (axis - change) * (axis + change) / (axis * axis);
  const double slope = direction.dot(e), start = m.dot(e);
  const double lowest = -taper * radiusP, highest = axis - taper * radiusQ;
  Range between{-kInfinite, kInfinite};
  if (slope != 0.0) {
    between = {(lowest - start) / slope, (highest - start) / slope};
    if (slope < 0.0) std::swap(between.first, between.last);
  } else if (!(start >= lowest && start <= highest)) {
    return;
  }
  const Eigen::Vector3d across = direction - slope * e, from = m - start * e;
  const double radius = radiusP + taper * start, growth = taper * slope;
  forEachBelow(squareOfCosine * across.squaredNorm() - growth * growth,
               squareOfCosine * across.dot(from) - radius * growth,
               squareOfCosine * from.squaredNorm() - radius * radius, between, f);
}

}  // namespace

std::optional<RayInterval> intersectRay(const RaySegment& ray, const Eigen::Vector3d& p,
                                        const Eigen::Vector3d& q, double radiusP, double radiusQ) {
  PALPATE_ASSERT(radiusP >= 0.0 && radiusQ >= 0.0);
  // The direction has length 1 here, and s = 0 where the ray is nearest to the segment's middle.
  const double length = stableLength(ray.direction);
  const Eigen::Vector3d d = ray.direction / length, middle = 0.5 * p + 0.5 * q;
  const double shift = (middle - ray.origin).dot(d);
  const Eigen::Vector3d nearest = ray.origin + shift * d;
  const double scale = scaleTowardsOne(
                   std::max({largest(nearest - p), largest(nearest - q), radiusP, radiusQ})),
               unit = 1.0 / scale;
  const Eigen::Vector3d m = scale * (nearest - p), n = scale * (nearest - q), u = scale * (q - p);
  radiusP *= scale;
  radiusQ *= scale;
  const double axis = u.norm(), change = radiusQ - radiusP;

  // The body is convex: one interval, from the parts in both balls and in the cone between them.
  Range all{kInfinite, -kInfinite};
  const auto add = [&](const Range& part) {
    all.first = std::min(all.first, part.first);
    all.last = std::max(all.last, part.last);
  };
  const Range line{-kInfinite, kInfinite};
  const auto addBall = [&](const Eigen::Vector3d& from, double radius) {
    const double along = from.dot(d);
    // |from|² - along² without cancellation
    forEachBelow(1.0, along, along * along + (from - along * d).squaredNorm() - radius * radius,
                 line, add);
  };
  const double room = (axis - change) * (axis + change);
  const bool hasCone = room > 0.0;
  if (hasCone || change <= 0.0) addBall(m, radiusP);
  if (hasCone || change > 0.0) addBall(n, radiusQ);
  if (hasCone) forEachInCone(d, m, u, radiusP, radiusQ, add);

  const double size = std::abs(shift) + unit * axis + unit * std::max(radiusP, radiusQ);
  const double first = (shift + unit * all.first) / length,
               last = (shift + unit * all.last) / length;
  if (!(first <= last) || last < ray.tMin || first > ray.tMax) return {};
  return RayInterval{std::max(first, ray.tMin), std::min(last, ray.tMax),
                     kRoundRayError * size / length, std::int8_t{last <= ray.tMax},
                     first >= ray.tMin};
}

namespace {

/// Of a ray with the prism between the two copies of a triangle at `radius` from its plane.
std::optional<RayInterval> intersectPrism(const RaySegment& ray, const Eigen::Vector3d& a,
                                          const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                          double radius) {
  const double length = stableLength(ray.direction);
  const Eigen::Vector3d d = ray.direction / length;
  const double shift = (a - ray.origin).dot(d);  // s = 0 where the ray is nearest to a
  const Eigen::Vector3d nearest = ray.origin + shift * d - a;
  const double scale = scaleTowardsOne(
                   std::max({largest(nearest), largest(b - a), largest(c - a), radius})),
               unit = 1.0 / scale;
  const Eigen::Vector3d n = unitCross(a, b, a, c), from = scale * nearest;
  if (n.isZero(0.0)) return {};
  const Eigen::Vector3d* const corners[] = {&a, &b, &c};
  Range inside{-kInfinite, kInfinite};
  const auto clip = [&](double height, double slope, double most) {  // height + s slope <= most
    if (slope > 0.0) {
      inside.last = std::min(inside.last, (most - height) / slope);
    } else if (slope < 0.0) {
      inside.first = std::max(inside.first, (most - height) / slope);
    } else if (height > most) {
      inside.last = -kInfinite;
    }
  };
  clip(from.dot(n), d.dot(n), scale * radius);
  clip(-from.dot(n), -d.dot(n), scale * radius);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d &p = *corners[i], &q = *corners[(i + 1) % 3];
    const Eigen::Vector3d outward = (scale * (q - p)).cross(n);
    clip((from - scale * (p - a)).dot(outward), d.dot(outward), 0.0);
  }
  // The sides of a thin triangle are nearly parallel, so that rounding moves their common points
  // far along them. The triangle does not reach beyond the ends of its longest side.
  int longest = 0;
  const auto along = [&](int i) -> Eigen::Vector3d {
    return scale * (*corners[(i + 1) % 3] - *corners[i]);
  };
  for (int i = 1; i < 3; ++i)
    if (along(i).squaredNorm() > along(longest).squaredNorm()) longest = i;
  const Eigen::Vector3d side = along(longest), start = scale * (*corners[longest] - a);
  clip((start - from).dot(side), -d.dot(side), 0.0);
  clip((from - start - side).dot(side), d.dot(side), 0.0);
  const double first = (shift + unit * inside.first) / length,
               last = (shift + unit * inside.last) / length;
  if (!(first <= last) || last < ray.tMin || first > ray.tMax) return {};
  const double size =
      std::abs(shift) + 2.0 * (largest(b - a) + largest(c - a)) + radius;  // without overflow
  return RayInterval{std::max(first, ray.tMin), std::min(last, ray.tMax),
                     kRoundRayError * size / length, std::int8_t{last <= ray.tMax},
                     first >= ray.tMin};
}

}  // namespace

std::optional<RayInterval> intersectRay(const RaySegment& ray, const Eigen::Vector3d& a,
                                        const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                        double radius) {
  PALPATE_ASSERT(radius > 0.0);
  // The body is convex: it is the union of three capsules and of the prism between the triangle's
  // two copies at the radius from its plane.
  std::optional<RayInterval> all;
  const auto add = [&](const RayInterval& part) {
    if (!all) {
      all = part;
      return;
    }
    // A part that holds the ray's own begin or end is the first or last one.
    all->first = std::min(all->first, part.first);
    all->frontFace = all->frontFace && part.frontFace;
    all->last = std::max(all->last, part.last);
    all->crossing = std::min(all->crossing, part.crossing);
    all->error = std::max(all->error, part.error);
  };
  const Eigen::Vector3d* const corners[] = {&a, &b, &c};
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d &p = *corners[i], &q = *corners[(i + 1) % 3];
    if (const auto capsule = intersectRay(ray, p, q, radius, radius)) add(*capsule);
  }
  if (const auto prism = intersectPrism(ray, a, b, c, radius)) add(*prism);
  return all;
}

}  // namespace palpate
