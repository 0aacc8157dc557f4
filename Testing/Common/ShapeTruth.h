#pragma once

#include <palpate/AnalyticalGeometry.h>

#include "Common/RandomMeshes.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <limits>
#include <vector>

/// Analytical shapes by their definition: their extent along a direction.
namespace palpate::testing {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The minimum of a convex function over [0, 1].
template <class F>
double minimumOf(F&& f) {
  double low = 0, high = 1;
  for (int i = 0; i < 50; ++i) {
    const double third = (high - low) / 3;
    if (f(low + third) <= f(high - third))
      high -= third;
    else
      low += third;
  }
  return std::min({f(0.0), f(1.0), f(0.5 * (low + high))});
}

struct PlacedShape {
  AnalyticalGeometry geometry;
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
};

inline Matrix3d randomTurn(Random& random) {
  return Eigen::Quaterniond(Eigen::Vector4d(uniform(random, -1, 1), uniform(random, -1, 1),
                                            uniform(random, -1, 1), uniform(random, 0.1, 1))
                                .normalized())
      .toRotationMatrix();
}

/// For a body that is the hull of corners with a ball of `radius` around it: its corners. For
/// others: none.
inline std::vector<Vector3d> cornersOf(const PlacedShape& shape, double& radius) {
  std::vector<Vector3d> corners;
  radius = 0;
  if (const auto* s = std::get_if<Sphere>(&shape.geometry)) {
    corners = {s->centre};
    radius = s->radius;
  } else if (const auto* c = std::get_if<Capsule>(&shape.geometry)) {
    corners = {c->p0, c->p1};
    radius = c->radius;
  } else if (const auto* b = std::get_if<Box>(&shape.geometry)) {
    for (int v = 0; v < 8; ++v)
      corners.push_back(
          b->centre +
          Vector3d(v & 1 ? 1 : -1, v & 2 ? 1 : -1, v & 4 ? 1 : -1).cwiseProduct(b->halfExtents));
  } else if (const auto* h = std::get_if<ConvexHull>(&shape.geometry)) {
    corners = h->points;
  }
  for (Vector3d& p : corners) p = shape.rotation * p + shape.translation;
  return corners;
}

/// The largest m . x in the shape, or infinity if there is none. m: unit vector.
inline double reachOf(const PlacedShape& shape, const Vector3d& m) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double radius = 0, most = -kInfinity;
  for (const Vector3d& p : cornersOf(shape, radius)) most = std::max(most, m.dot(p) + radius);
  if (most > -kInfinity) return most;
  const Vector3d u = shape.rotation.transpose() * m;
  if (const auto* c = std::get_if<Cylinder>(&shape.geometry)) {
    const Vector3d axis = (c->p1 - c->p0).normalized();
    return std::max(u.dot(c->p0), u.dot(c->p1)) + c->radius * u.cross(axis).norm() +
           m.dot(shape.translation);
  }
  const auto& plane = std::get<Plane>(shape.geometry);
  const Vector3d normal = plane.normal.normalized();
  const bool along = u.cross(normal).norm() < 1e-12 && (plane.twoSided || u.dot(normal) > 0);
  return along ? u.dot(plane.point) + m.dot(shape.translation) : kInfinity;
}

/// The gap of the shapes along m, from b towards a.
inline double apartAlong(const PlacedShape& a, const PlacedShape& b, const Vector3d& m) {
  return -reachOf(a, -m) - reachOf(b, m);
}

/// Directions that include all in which two hulls of corners can first separate.
inline std::vector<Vector3d> facetDirections(const PlacedShape& a, const PlacedShape& b) {
  std::vector<Vector3d> edges, directions;
  double radius = 0;
  for (const auto* shape : {&a, &b}) {
    const std::vector<Vector3d> corners = cornersOf(*shape, radius);
    for (std::size_t i = 0; i < corners.size(); ++i)
      for (std::size_t j = 0; j < i; ++j) edges.push_back(corners[i] - corners[j]);
  }
  for (std::size_t i = 0; i < edges.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const Vector3d across = edges[i].cross(edges[j]);
      if (!(across.norm() > 1e-9 * edges[i].norm() * edges[j].norm())) continue;
      directions.push_back(across.normalized());
      directions.push_back(-directions.back());
    }
  return directions;
}

}  // namespace palpate::testing
