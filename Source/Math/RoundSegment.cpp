#include "Math/RoundSegment.h"

#include "Exact/Compensated.h"
#include "Math/Foot.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"

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

RoundIntervals intersectRay(const RaySegment& ray, const Eigen::Vector3d& p,
                            const Eigen::Vector3d& q, double radiusP, double radiusQ) {
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
  const double square = u.squaredNorm();

  std::array<Range, 6> parts;
  std::size_t count = 0;
  const auto add = [&](const Range& part) {
    parts[count++] = {unit * part.first, unit * part.last};
  };
  const auto addBall = [&](const Eigen::Vector3d& from, double radius, const Range& within) {
    const double along = from.dot(d);
    // |from|² - along² without cancellation
    forEachBelow(1.0, along, along * along + (from - along * d).squaredNorm() - radius * radius,
                 within, add);
  };
  const Range all{-kInfinite, kInfinite};
  if (!(square > 0.0)) {
    addBall(m, std::max(radiusP, radiusQ), all);
  } else {
    // w = (m . u + s d . u) / |u|² is the place along the segment.
    const double slope = d.dot(u), start = m.dot(u), taper = (radiusQ - radiusP) / square;
    Range before = all, between = all, after = all;
    const double atP = -start / slope, atQ = (square - start) / slope;
    if (slope > 0.0) {
      before.last = between.first = atP;
      after.first = between.last = atQ;
    } else if (slope < 0.0) {
      before.first = between.last = atP;
      after.last = between.first = atQ;
    }
    const bool isParallel = !(slope > 0.0 || slope < 0.0);
    if (!isParallel || start <= 0.0) addBall(m, radiusP, before);
    if (!isParallel || start >= square) addBall(n, radiusQ, after);
    if (!isParallel || (start > 0.0 && start < square)) {
      const Eigen::Vector3d across = d - slope / square * u, from = m - start / square * u;
      const double radius = radiusP + taper * start, change = taper * slope;
      forEachBelow(across.squaredNorm() - change * change, across.dot(from) - radius * change,
                   from.squaredNorm() - radius * radius, between, add);
    }
  }

  for (std::size_t i = 1; i < count; ++i)
    for (std::size_t at = i; at > 0 && parts[at].first < parts[at - 1].first; --at)
      std::swap(parts[at], parts[at - 1]);
  RoundIntervals result;
  const double size =
      std::abs(shift) + unit * std::sqrt(square) + unit * std::max(radiusP, radiusQ);
  const double slack = kRoundRayError * size;
  for (std::size_t i = 0; i < count;) {
    Range part = parts[i++];
    for (; i < count && parts[i].first <= part.last + slack; ++i)
      part.last = std::max(part.last, parts[i].last);
    const double first = (shift + part.first) / length, last = (shift + part.last) / length;
    if (last < ray.tMin || first > ray.tMax || result.size == result.intervals.size()) continue;
    result.intervals[result.size++] = {std::max(first, ray.tMin), std::min(last, ray.tMax),
                                       slack / length, std::int8_t{last <= ray.tMax},
                                       first >= ray.tMin};
  }
  return result;
}

std::optional<RayInterval> intersectRay(const RaySegment& ray, const Eigen::Vector3d& a,
                                        const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                        double radius) {
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
    const RoundIntervals capsule = intersectRay(ray, p, q, radius, radius);
    for (std::size_t k = 0; k < capsule.size; ++k) add(capsule.intervals[k]);
  }
  const double length = stableLength(ray.direction);
  const Eigen::Vector3d d = ray.direction / length;
  const double shift = (a - ray.origin).dot(d);  // s = 0 where the ray is nearest to a
  const Eigen::Vector3d nearest = ray.origin + shift * d - a;
  const double scale = scaleTowardsOne(
                   std::max({largest(nearest), largest(b - a), largest(c - a), radius})),
               unit = 1.0 / scale;
  const Eigen::Vector3d n = unitCross(a, b, a, c), from = scale * nearest;
  if (n.isZero(0.0)) return all;
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
  if (first <= last && last >= ray.tMin && first <= ray.tMax) {
    const double size =
        std::abs(shift) + 2.0 * (largest(b - a) + largest(c - a)) + radius;  // without overflow
    add({std::max(first, ray.tMin), std::min(last, ray.tMax), kRoundRayError * size / length,
         std::int8_t{last <= ray.tMax}, first >= ray.tMin});
  }
  return all;
}

}  // namespace palpate
