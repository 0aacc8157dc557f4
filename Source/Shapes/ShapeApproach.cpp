#include "Shapes/ShapeApproach.h"

#include "Shapes/ShapeLengths.h"
#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <algorithm>
#include <limits>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The most points of a round body that are computed. Between corners, far fewer points come nearer
/// and nearer.
constexpr int kMaxPoints = 128;

}  // namespace

ShapeApproach::ShapeApproach(const MovingBody& a, const MovingBody& b)
    : m_a(a), m_b(b), m_reference{b.corners[0][0], b.corners[1][0]} {
  m_size = (a.radius + b.radius) + (a.cylinderRadius + b.cylinderRadius);
  double furthest = 0;
  for (const MovingBody* body : {&m_a, &m_b}) {
    PALPATE_ASSERT(body->corners[0].size() == body->corners[1].size());
    PALPATE_ASSERT(body->cylinderRadius == 0.0 || body->corners[0].size() == 2);
    for (const std::size_t end : {0, 1})
      for (const Vector3d& p : body->corners[end])
        furthest = std::max(furthest, largest(p - m_reference[end]));
  }
  m_size += furthest;
  m_direction = directionOf(corner(m_a, 0, 0.5) - corner(m_b, 0, 0.5));
  if (m_direction == Vector3d::Zero()) m_direction = Vector3d::UnitX();
}

Vector3d ShapeApproach::corner(const MovingBody& body, std::size_t i, double time) const {
  return (1.0 - time) * (body.corners[0][i] - m_reference[0]) +
         time * (body.corners[1][i] - m_reference[1]);
}

/// The greatest height of the corners along a direction.
double ShapeApproach::highest(const MovingBody& body, const Vector3d& direction,
                              double time) const {
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < body.corners[0].size(); ++i)
    most = std::max(most, dot(direction, corner(body, i, time)));
  return most;
}

Vector3d ShapeApproach::furthest(const MovingBody& body, const Vector3d& direction,
                                 double time) const {
  double most = -std::numeric_limits<double>::infinity();
  Vector3d best = Vector3d::Zero();
  for (std::size_t i = 0; i < body.corners[0].size(); ++i) {
    const Vector3d p = corner(body, i, time);
    const double height = dot(direction, p);
    if (height > most) most = height, best = p;
  }
  if (!(body.cylinderRadius > 0)) return best;
  const Vector3d axis = directionOf(corner(body, 1, time) - corner(body, 0, time));
  Vector3d across = direction - dot(direction, axis) * axis;
  if (!(across.squaredNorm() > kOnSurface * kOnSurface)) return best;  // only rounding
  across = across.normalized();
  return best + body.cylinderRadius * (across - dot(across, axis) * axis).normalized();
}

/// An upper bound on how far a cylinder's lateral surface reaches beyond its axis along a
/// direction, in a part of the step. The axis turns in a plane, by less than half a turn. The sine
/// of its angle to the direction is therefore greatest at an end, unless the axis becomes
/// perpendicular to the direction in between.
double ShapeApproach::lateralExtent(const MovingBody& body, const Vector3d& direction, double from,
                                    double to) const {
  if (!(body.cylinderRadius > 0)) return 0;
  const Vector3d first = directionOf(corner(body, 1, from) - corner(body, 0, from)),
                 last = directionOf(corner(body, 1, to) - corner(body, 0, to));
  const double start = dot(direction, first), end = dot(direction, last);
  if (!((start > 0 && end > 0) || (start < 0 && end < 0))) return body.cylinderRadius;
  return body.cylinderRadius *
         std::max(direction.cross(first).norm(), direction.cross(last).norm());
}

bool ShapeApproach::separates(const Vector3d& direction, double from, double to,
                              double distance) const {
  const double between = std::min(-highest(m_a, -direction, from) - highest(m_b, direction, from),
                                  -highest(m_a, -direction, to) - highest(m_b, direction, to));
  return between -
             (lateralExtent(m_a, direction, from, to) + lateralExtent(m_b, direction, from, to)) -
             (m_a.radius + m_b.radius) >
         distance + kShapeBoundError * (m_size + distance);
}

/// Up to four points of the Minkowski difference a - b, and their point nearest to the origin.
struct ShapeApproach::Simplex {
  struct Point {
    Vector3d difference, ofA;
  };
  std::array<Point, 4> points;
  std::array<double, 4> weights;
  int size = 0;

  bool contains(const Vector3d& difference) const {
    return std::any_of(points.begin(), points.begin() + size,
                       [&](const Point& p) { return p.difference == difference; });
  }

  /// Whether the origin is in the tetrahedron of all four points.
  bool surroundsOrigin(SignCounts& counts) const {
    const Vector3d origin = Vector3d::Zero();
    const auto at = [&](int i) -> const Vector3d& { return points[i & 3].difference; };
    for (int i = 0; i < 4; ++i) {
      const OrientedPlane plane(at(i + 1), at(i + 2), at(i + 3));
      const int side = plane.side(at(i), counts);
      if (side == 0 || side == -plane.side(origin, counts)) return false;
    }
    return true;
  }

  /// Keeps only the points whose hull contains the point nearest to the origin. For a tetrahedron,
  /// that point is on a face with the last point, because the other three points were the nearest
  /// ones before it was added.
  VertexTriangleDistance reduce() {
    PALPATE_ASSERT(size >= 1 && size <= 4);
    const Vector3d origin = Vector3d::Zero();
    const auto of = [&](int i, int j, int k) {
      return finiteVertexTriangleDistance(origin, points[i].difference, points[j].difference,
                                          points[k].difference);
    };
    std::array<int, 3> face{0, std::min(1, size - 1), size == 4 ? 3 : size - 1};
    VertexTriangleDistance best = of(face[0], face[1], face[2]);
    if (size == 4)
      for (const std::array<int, 3>& other : {std::array{0, 2, 3}, std::array{1, 2, 3}}) {
        const VertexTriangleDistance on = of(other[0], other[1], other[2]);
        if (on.distance < best.distance) best = on, face = other;
      }
    const std::array<Point, 4> all = points;
    size = 0;
    for (int i = 0; i < 3; ++i) {
      if (!(best.weights[i] > 0)) continue;
      points[size] = all[face[i]];
      weights[size++] = best.weights[i];
    }
    return best;
  }
};

/// isEnough(normal, lower, upper): whether the bounds on the distance, and the direction, are good
/// enough.
template <class IsEnough>
ShapeApproach::Nearest ShapeApproach::nearest(double time, IsEnough&& isEnough) {
  SignCounts counts;
  Simplex simplex;
  Nearest found{Vector3d::Zero(), Vector3d::Zero(), m_direction, 0};
  double upper = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kMaxPoints; ++i) {
    const Vector3d ofA = furthest(m_a, -found.normal, time),
                   difference = ofA - furthest(m_b, found.normal, time);
    const double lower = dot(found.normal, difference);
    if (isEnough(found.normal, lower, upper) || !(upper - lower > kShapePairGap * m_size) ||
        simplex.contains(difference))
      break;
    simplex.points[simplex.size++] = {difference, ofA};
    if (simplex.size == 4 && simplex.surroundsOrigin(counts)) {
      found.distance = 0;
      break;
    }
    const VertexTriangleDistance on = simplex.reduce();
    m_exactDecisions += on.exact;
    if (!(on.distance < upper)) break;
    upper = found.distance = on.distance;
    if (upper == 0) break;
    found.normal = -on.normal;
    found.ofA = Vector3d::Zero();
    for (int k = 0; k < simplex.size; ++k) found.ofA += simplex.weights[k] * simplex.points[k].ofA;
    found.ofB = found.ofA + on.difference;
  }
  m_exactDecisions += counts.undecided;
  return found;
}

bool ShapeApproach::isExcluded(double from, double to, double distance) {
  if (separates(m_direction, from, to, distance)) return true;
  const double centreDistance = distance + (m_a.radius + m_b.radius);
  bool excluded = false;
  nearest(0.5 * (from + to), [&](const Vector3d& normal, double lower, double upper) {
    if (!(upper > centreDistance)) return true;  // too near already
    if (!(lower > centreDistance) || !separates(normal, from, to, distance)) return false;
    m_direction = normal;
    return excluded = true;
  });
  return excluded;
}

std::optional<double> ShapeApproach::firstTimeWithin(double distance, double tolerance) {
  return firstTimeNotExcluded(
      tolerance, [&](double from, double to) { return isExcluded(from, to, distance); });
}

ShapePairDistance ShapeApproach::nearestAt(double time) {
  PALPATE_ASSERT(time >= 0.0 && time <= 1.0);
  const Nearest at = nearest(time, [](const Vector3d&, double, double) { return false; });
  const Vector3d reference = (1.0 - time) * m_reference[0] + time * m_reference[1];
  return {at.ofA - m_a.radius * at.normal + reference, at.ofB + m_b.radius * at.normal + reference,
          at.normal, at.distance - m_a.radius - m_b.radius};
}

}  // namespace palpate
