#pragma once

#include <palpate/AnalyticalGeometry.h>

#include "Common/RandomMeshes.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <optional>
#include <variant>
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
  const double w = uniform(random, 0.1, 1), z = uniform(random, -1, 1), y = uniform(random, -1, 1),
               x = uniform(random, -1, 1);
  return Eigen::Quaterniond(Eigen::Vector4d(x, y, z, w).normalized()).toRotationMatrix();
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

/// Triangles that cover a hull's surface, each with its plane: every three points with all others
/// on one side. If all points are in one plane: every three.
struct Facets {
  struct Facet {
    std::array<Vector3d, 3> corners;
    Vector3d normal;  ///< out
    double turn;      ///< 1: by the corners' winding, too
  };
  std::vector<Facet> all;
  bool isBody = false;

  explicit Facets(const std::vector<Vector3d>& points) {
    const std::size_t n = points.size();
    for (const bool body : {true, false}) {
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = i; j < n; ++j)
          for (std::size_t k = j; k < n; ++k) {
            Vector3d normal = (points[j] - points[i]).cross(points[k] - points[i]);
            double above = 0, below = 0;
            for (const Vector3d& p : points) {
              const double height = normal.normalized().dot(p - points[i]);
              above = std::max(above, height);
              below = std::min(below, height);
            }
            if (body && (normal.norm() < 1e-12 || std::min(above, -below) > 1e-12)) continue;
            isBody |= body && std::max(above, -below) > 1e-12;
            const double turn = above > -below ? -1 : 1;
            normal = turn * normal.normalized();
            all.push_back({{points[i], points[j], points[k]}, normal, turn});
            if (body || normal == Vector3d::Zero()) continue;
            all.push_back({{points[i], points[j], points[k]}, -normal, -turn});
          }
      if (isBody) return;
      if (body) all.clear();
    }
  }

  double signedDistance(const Vector3d& x) const {
    double highest = -std::numeric_limits<double>::infinity(), nearest = -highest;
    for (const Facet& f : all) {
      const double height = f.normal.dot(x - f.corners[0]);
      highest = std::max(highest, height);
      if (height < -1e-14) continue;
      bool over = true;
      for (int i = 0; i < 3; ++i) {
        const Vector3d &p = f.corners[i], edge = f.corners[(i + 1) % 3] - p, from = x - p;
        over &= f.normal.dot(edge.cross(from)) * f.turn > 0;
        const double square = edge.squaredNorm(),
                     t = square > 0 ? std::clamp(from.dot(edge) / square, 0.0, 1.0) : 0.0;
        nearest = std::min(nearest, (from - t * edge).norm());
      }
      if (over) nearest = std::min(nearest, std::abs(height));
    }
    return isBody && highest < 0 ? highest : nearest;
  }
};

/// A shape with its distance. A hull must have fewer than ten points.
struct MeasuredShape : PlacedShape {
  std::optional<Facets> facets{};

  MeasuredShape(const AnalyticalGeometry& shape, const Matrix3d& turn = Matrix3d::Identity(),
                const Vector3d& shift = Vector3d::Zero())
      : PlacedShape{shape, turn, shift} {
    const auto* hull = std::get_if<ConvexHull>(&geometry);
    if (hull && hull->points.size() < 10) facets.emplace(hull->points);
  }
  /// From its definition.
  double signedDistance(const Vector3d& world) const {
    const Vector3d x = rotation.transpose() * (world - translation);
    const auto ofBox = [](std::initializer_list<double> beyond) {
      double outside = 0;
      for (const double b : beyond) outside += b > 0 ? b * b : 0;
      return outside > 0 ? std::sqrt(outside) : std::max(beyond);
    };
    if (const auto* s = std::get_if<Sphere>(&geometry)) return (x - s->centre).norm() - s->radius;
    if (const auto* c = std::get_if<Capsule>(&geometry)) {
      const Vector3d u = c->p1 - c->p0;
      const double t = u.dot(x - c->p0) / u.squaredNorm();
      return (x - c->p0 - std::clamp(t, 0.0, 1.0) * u).norm() - c->radius;
    }
    if (const auto* p = std::get_if<Plane>(&geometry)) {
      const double height = p->normal.normalized().dot(x - p->point);
      return p->twoSided ? std::abs(height) : height;
    }
    if (const auto* b = std::get_if<Box>(&geometry)) {
      const Vector3d beyond = (x - b->centre).cwiseAbs() - b->halfExtents;
      return ofBox({beyond[0], beyond[1], beyond[2]});
    }
    if (facets) return facets->signedDistance(x);
    const auto& c = std::get<Cylinder>(geometry);
    const Vector3d u = (c.p1 - c.p0).normalized(), from = x - 0.5 * (c.p0 + c.p1);
    return ofBox(
        {u.cross(from).norm() - c.radius, std::abs(u.dot(from)) - 0.5 * (c.p1 - c.p0).norm()});
  }
};

/// The least distance on a segment, and on a triangle: of functions that are convex.
inline double leastOn(const MeasuredShape& shape, const Vector3d& p, const Vector3d& q) {
  return minimumOf([&](double t) { return shape.signedDistance(p + t * (q - p)); });
}
inline double leastOn(const MeasuredShape& shape, const Vector3d& a, const Vector3d& b,
                      const Vector3d& c) {
  return minimumOf([&](double t) { return leastOn(shape, a + t * (b - a), a + t * (c - a)); });
}

/// One of each kind, about 0.3 large and around the origin. Some are flat, thin, or a point.
inline std::vector<AnalyticalGeometry> shapesOfEveryKind(Random& random) {
  std::vector<Vector3d> cloud, plate;
  for (int i = 0; i < 8; ++i) cloud.push_back(randomPoint(random, -0.3, 0.3));
  for (int i = 0; i < 5; ++i)
    plate.push_back({uniform(random, -.3, .3), 0.1, uniform(random, -.3, .3)});
  return {Sphere{{0.01, 0, 0}, 0.25},
          Capsule{{-0.3, 0, 0}, {0.2, 0.1, 0}, 0.1},
          Plane{{0, 0.05, 0}, {1, 2, 3}, false},
          Plane{{0, 0.05, 0}, {1, -2, 3}, true},
          Box{{0.05, 0, 0}, {0.3, 0.2, 0.1}},
          Cylinder{{-0.2, 0, 0}, {0.3, 0.1, 0}, 0.15},
          ConvexHull{cloud},
          Sphere{{0, 0, 0}, 0},
          Capsule{{-0.3, 0, 0}, {0.2, 0.1, 0}, 0},
          Box{{0, 0, 0}, {0.3, 0.2, 0}},
          Cylinder{{-0.2, 0, 0}, {0.3, 0.1, 0}, 0},
          Cylinder{{0, 0, -0.01}, {0, 0, 0.01}, 0.4},
          ConvexHull{plate},
          ConvexHull{{{-0.3, 0, 0}, {0.1, 0, 0}, {0.3, 0, 0}}},
          ConvexHull{{{0.1, 0, 0}, {0.1, 0, 0}}}};
}

/// Shapes on a grid around the origin: with parallel parts, flat, thin, or a point.
inline std::vector<AnalyticalGeometry> degenerateShapes() {
  return {Sphere{{0, 0, 0}, 1},
          Sphere{{1, 0, 0}, 0},
          Capsule{{0, 0, 0}, {2, 0, 0}, 0},
          Capsule{{0, 0, 0}, {0, 2, 0}, 1},
          Capsule{{1, 1, 1}, {1, 1, 1}, 1},
          Plane{{0, 0, 0}, {0, 0, 1}, false},
          Plane{{0, 0, 0}, {0, 1, 1}, true},
          Box{{0, 0, 0}, {0, 0, 0}},
          Box{{0, 0, 0}, {1, 1, 0}},
          Box{{0, 0, 0}, {0, 1, 0}},
          Box{{0, 0, 0}, {1, 1, 1}},
          Box{{0, 0, 0}, {1, 2, 0.5}},
          Cylinder{{0, 0, -1}, {0, 0, 1}, 1},
          Cylinder{{0, -1, 0}, {0, 1, 0}, 0.5},
          Cylinder{{0, 0, -1}, {0, 0, 1}, 0},
          ConvexHull{{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}},
          ConvexHull{{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}}},
          ConvexHull{{{0, 0, 0}, {2, 2, 2}, {1, 1, 1}}},
          ConvexHull{{{1, 1, 1}}}};
}

}  // namespace palpate::testing
