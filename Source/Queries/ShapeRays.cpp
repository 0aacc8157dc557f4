#include "Queries/ShapeRays.h"

#include "Math/RayTriangle.h"
#include "Math/RoundSegment.h"
#include "Math/StableLength.h"
#include "Exact/Compensated.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The part of a ray inside a convex shape, and whether the ray itself begins or ends inside.
struct Inside {
  double enter, leave;
  bool beginsInside, endsInside;
};

std::optional<Inside> clipped(double enter, double leave, const Ray& ray) {
  if (!(enter <= leave) || leave < ray.tMin || enter > ray.tMax) return {};
  const bool beginsInside = enter < ray.tMin;
  const bool endsInside = leave > ray.tMax || std::isinf(leave);
  return Inside{std::max(enter, ray.tMin), std::min(leave, ray.tMax), beginsInside, endsInside};
}

std::optional<Inside> insideCapsule(const Shape& shape, const Ray& ray) {
  const auto part =
      intersectRay({ray.origin, ray.direction, ray.tMin, ray.tMax}, shape.corners().front(),
                   shape.corners().back(), shape.radius(), shape.radius());
  if (!part) return {};
  return Inside{part->first, part->last, !part->frontFace, part->crossing == 0};
}

/// A cylinder is the common part of a slab and an infinite cylinder.
std::optional<Inside> insideCylinder(const Shape& shape, const Ray& ray) {
  const Vector3d p = shape.corners()[0], q = shape.corners()[1], axis = shape.axes().col(2);
  const double length = stableLength(ray.direction);
  const Vector3d d = ray.direction / length;
  // s = 0 where the ray is nearest to the centre
  const double shift = (shape.origin() - ray.origin).dot(d);
  const Vector3d nearest = ray.origin + shift * d - shape.origin();
  const double scale =
                   scaleTowardsOne(std::max({largest(nearest), largest(q - p), shape.radius()})),
               unit = 1.0 / scale, half = 0.5 * (scale * (q - p)).norm(),
               radius = scale * shape.radius();
  const Vector3d from = scale * nearest;
  double enter = -kInfinity, leave = kInfinity;
  const double slope = d.dot(axis), height = from.dot(axis);
  if (slope != 0.0) {
    const double s = (-half - height) / slope, t = (half - height) / slope;
    enter = std::min(s, t);
    leave = std::max(s, t);
  } else if (std::abs(height) > half) {
    return {};
  }
  const Vector3d across = d - slope * axis, radial = from - height * axis;
  const double a = across.squaredNorm(), b = across.dot(radial),
               c = radial.squaredNorm() - radius * radius;
  if (a > 0.0) {
    const double discriminant = b * b - a * c;
    if (discriminant < 0.0) return {};
    const double root = std::sqrt(discriminant);
    enter = std::max(enter, (-b - root) / a);
    leave = std::min(leave, (-b + root) / a);
  } else if (c > 0.0) {
    return {};
  }
  return clipped((shift + unit * enter) / length, (shift + unit * leave) / length, ray);
}

std::optional<Inside> insideHull(const Shape& shape, const Ray& ray) {
  const RaySegment whole{ray.origin, ray.direction, -std::numeric_limits<double>::max(), kInfinity};
  double enter = kInfinity, leave = -kInfinity;
  for (const auto& [a, b, c] : shape.faces()) {
    const auto corners = shape.corners();
    const auto interval = intersectRay(whole, corners[a], corners[b], corners[c]);
    if (!interval) continue;
    enter = std::min(enter, interval->first);
    leave = std::max(leave, interval->last);
  }
  return clipped(enter, leave, ray);
}

std::optional<Inside> insidePlane(const Shape& shape, const Ray& ray) {
  const Vector3d normal = shape.axes().col(2);
  const double height = (ray.origin - shape.origin()).dot(normal),
               slope = ray.direction.dot(normal);
  if (slope == 0.0) {
    if (height > 0.0 || (shape.isTwoSided() && height < 0.0)) return {};
    return clipped(-kInfinity, kInfinity, ray);
  }
  const double t = -height / slope;
  if (shape.isTwoSided()) return clipped(t, t, ray);
  return slope < 0.0 ? clipped(t, kInfinity, ray) : clipped(-kInfinity, t, ray);
}

}  // namespace

void addShapeHits(GeometryId id, const Shape& shape, const Ray& ray, std::vector<RayHit>& out) {
  const auto inside = shape.isPlane()            ? insidePlane(shape, ray)
                      : shape.isCylinder()       ? insideCylinder(shape, ray)
                      : shape.faces().size() > 1 ? insideHull(shape, ray)
                                                 : insideCapsule(shape, ray);
  if (!inside) return;
  const auto add = [&](double t, bool frontFace, bool crosses) {
    // Not -0.
    out.push_back({id, kNoElement, {}, Vector3d::Zero(), t + 0.0, frontFace, crosses});
  };
  if (shape.isTwoSided()) {
    const double slope = ray.direction.dot(shape.axes().col(2));
    return add(inside->enter, slope < 0.0, slope != 0.0);
  }
  const bool enters = !inside->beginsInside, leaves = !inside->endsInside;
  if (enters && leaves && inside->enter == inside->leave)  // they touch
    return add(inside->enter, true, false);
  if (enters) add(inside->enter, true, true);
  if (leaves) add(inside->leave, false, true);
}

SurfacePoint closestPointOnShape(GeometryId id, const Shape& shape, const Vector3d& point) {
  const PointShapeDistance distance = shape.signedDistance(point);
  return {id,
          kNoElement,
          {},
          Vector3d::Zero(),
          point - distance.distance * distance.normal,
          distance.distance,
          distance.normal};
}

}  // namespace palpate
