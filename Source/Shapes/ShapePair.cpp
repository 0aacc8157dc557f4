// Part of Shapes/Shape.h: the distance of two shapes.
#include "Shapes/Shape.h"
#include "Shapes/ShapeLengths.h"

#include "Math/Tolerances.h"
#include "Exact/Compensated.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Points of the Minkowski difference of two shapes, a - b: the furthest ones along directions.
class MinkowskiDifference {
 public:
  MinkowskiDifference(const Shape& a, const Shape& b)
      : m_a(a), m_b(b), m_offset(a.origin() - b.origin()) {}

  struct Point {
    Vector3d difference, ofA;
  };
  Point furthest(const Vector3d& direction) const {
    const Vector3d ofA = m_a.support(direction, 0);
    return {(ofA - m_b.support(-direction, 0)) + m_offset, ofA};
  }

  /// Finds four points that have a volume. Returns fewer if there are none, and a direction `flat`
  /// along which all points are equal.
  std::size_t start(std::array<Point, 4>& points, Vector3d& flat) const {
    const auto at = [&](std::size_t i) -> const Vector3d& { return points[i].difference; };
    points[0] = furthest(Vector3d::UnitX());
    flat = Vector3d::UnitX();
    const Vector3d axes[] = {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()};
    if (!extend(points[1], axes, [&](const Vector3d& p) { return lengthOf(p - at(0)); })) return 1;
    const Vector3d along = directionOf(at(1) - at(0));
    flat = along.unitOrthogonal();
    const Vector3d across[] = {flat, along.cross(flat)};
    if (!extend(points[2], across,
                [&](const Vector3d& p) { return lengthOf(along.cross(p - at(0))); }))
      return 2;
    flat = directionOf(along.cross(at(2) - at(0)));
    SignCounts counts;
    if (!extend(points[3], {&flat, 1},
                [&](const Vector3d& p) { return std::abs(flat.dot(p - at(0))); }) ||
        orient3d(at(0), at(1), at(2), at(3), counts) == 0)
      return 3;
    return 4;
  }

 private:
  /// Finds the point with the greatest measure among those furthest along or against the
  /// directions. Returns false if no measure is positive.
  template <class Measure>
  bool extend(Point& best, std::span<const Vector3d> directions, Measure&& measure) const {
    double most = 0;
    for (const Vector3d& direction : directions)
      for (const double sign : {1.0, -1.0}) {
        const Point point = furthest(sign * direction);
        if (!(measure(point.difference) > most)) continue;
        most = measure(point.difference);
        best = point;
      }
    return most > 0;
  }

  const Shape &m_a, &m_b;
  Vector3d m_offset;
};

/// The most points that are added for overlapping bodies with a round side.
constexpr std::size_t kMaxDifferencePoints = 256;

}  // namespace

Vector3d Shape::support(const Vector3d& direction, double tie) const {
  PALPATE_ASSERT(!isPlane() && tie >= 0.0);
  if (m_type == Type::Capsule) {
    const Vector3d along = m_p1 - m_p0;
    const double higher = dot(direction, along);
    return (std::abs(higher) <= tie ? 0.5 : higher > 0 ? 1.0 : 0.0) * along;
  }
  const Vector3d bodyDirection = m_axes.transpose() * direction;
  if (m_hull) return m_axes * m_hull->support(bodyDirection, tie);
  const Components components = componentsOf(bodyDirection, 0);
  Vector3d point = Vector3d::Zero();
  for (int i = 0; i < 2; ++i)
    if (components.lengths[i] * m_sizes[i] > 0.5 * tie)
      point += m_sizes[i] * components.directions[i];
  return m_axes * point;
}

bool Shape::precedes(const Shape& other) const {
  if (m_type != other.m_type) return m_type < other.m_type;
  if (radius() != other.radius()) return radius() < other.radius();
  const auto &ours = m_corners, &theirs = other.m_corners;
  for (std::size_t i = 0; i < std::min(ours.size(), theirs.size()); ++i)
    if (ours[i] != theirs[i])
      return std::lexicographical_compare(ours[i].begin(), ours[i].end(), theirs[i].begin(),
                                          theirs[i].end());
  return ours.size() < theirs.size();
}

/// The distance of this plane from a body.
ShapePairDistance Shape::planeDistance(const Shape& body) const {
  PALPATE_ASSERT(isPlane());
  const double tie = kOnSurface * (m_magnitude + body.m_magnitude);
  ShapePairDistance best{};
  best.distance = -std::numeric_limits<double>::infinity();
  for (const double side : {1.0, -1.0}) {
    if (side < 0 && m_type != Type::TwoSidedPlane) break;
    const Vector3d up = side * m_axes.col(2);
    const Vector3d lowest = body.support(-up, tie);
    const double distance = up.dot(lowest) + up.dot(body.m_p0 - m_p0) - body.m_radius;
    if (!(distance > best.distance)) continue;
    const Vector3d point = body.m_p0 + lowest - body.m_radius * up;
    best = {point - distance * up, point, -up, distance};
  }
  return best;
}

/// The distance of bodies whose Minkowski difference lies in one plane with normal `flat`. Each
/// body then lies in one plane itself.
ShapePairDistance Shape::planarDistance(const Shape& other, const Vector3d& flat) const {
  NearestToShape nearest{};
  Vector3d point = m_p0;
  nearest.distance = std::numeric_limits<double>::infinity();
  const auto take = [&](const std::optional<NearestToShape>& found, const Vector3d& a,
                        const Vector3d& b, const Vector3d& c) {
    if (!found || !(found->distance < nearest.distance)) return;
    nearest = *found;
    point = found->weights[0] * a + found->weights[1] * b + found->weights[2] * c;
  };
  const auto test = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    take(other.nearestInTriangle(a, b, c), a, b, c);
    take(other.nearestOfEdge(a, b), a, b, c);
    take(other.nearestOfEdge(b, c), b, c, a);
    take(other.nearestOfEdge(c, a), c, a, b);
  };
  if (m_hull) {
    for (const auto& [a, b, c] : m_faces) test(m_corners[a], m_corners[b], m_corners[c]);
  } else {
    take(other.nearestOfEdge(m_p0, m_p1), m_p0, m_p1, m_p1);
  }
  const double distance = nearest.distance + other.m_radius;  // a radius of 0 except for capsules
  const double tie = kOnSurface * (m_magnitude + other.m_magnitude);
  const Vector3d normal = distance > tie ? nearest.normal : flat;
  const Vector3d pointA = point - m_radius * normal;
  const double whole = distance - m_radius - other.m_radius;
  return {pointA, pointA - whole * normal, normal, whole};
}

ShapePairDistance Shape::minkowskiDistance(const Shape& other, ShapePairScratch& scratch) const {
  const MinkowskiDifference minkowski(*this, other);
  std::array<MinkowskiDifference::Point, 4> first;
  Vector3d flat;
  if (minkowski.start(first, flat) < 4) return planarDistance(other, flat);
  Polytope& polytope = scratch.polytope;
  Buffer<Vector3d>& pointsOfA = scratch.pointsOfA;
  std::array<Vector3d, 4> corners;
  pointsOfA.clear();
  double size = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    corners[i] = first[i].difference;
    pointsOfA.push_back(first[i].ofA);
    size = std::max(size, largest(corners[i]));
  }
  polytope.start(corners);
  const Vector3d origin = Vector3d::Zero();
  const double gap = std::max(kShapePairGap * size, kSmallestShapePairGap), tie = kOnSurface * size;
  const bool isRound = m_type == Type::Cylinder || other.m_type == Type::Cylinder;
  // Adds a furthest point that is further than the polytope is. Returns whether it did.
  const auto grow = [&](const MinkowskiDifference::Point& furthest, double height,
                        double polytopeHeight) {
    // A round body may be equally deep in any number of directions. Each of them separates the
    // bodies.
    const bool enough =
        isRound && polytopeHeight > 0 && polytope.points().size() >= kMaxDifferencePoints;
    if (!(height - polytopeHeight > gap) || enough || !polytope.add(furthest.difference))
      return false;
    pointsOfA.push_back(furthest.ofA);
    return true;
  };
  PointShapeDistance out;
  Polytope::OnFace on;
  for (;;) {
    out = polytope.signedDistance(origin, tie);
    const MinkowskiDifference::Point furthest = minkowski.furthest(out.normal);
    const double height = dot(out.normal, furthest.difference);
    if (grow(furthest, height, -out.distance)) continue;
    on = polytope.nearest(origin, tie);
    if (!(out.distance < 0)) break;
    out.distance = -height;
    const Vector3d aside = on.from.difference - out.distance * out.normal;
    if (!isRound && !(lengthOf(aside) > gap + tie)) break;
    // Several planes are equally near, and the foot may be beside the face of the first one.
    // Without round sides the nearest of all faces counts, because a sliver's plane may be rounded
    // by more than the tie.
    on = polytope.nearestFaceWithin(origin, isRound ? tie : std::numeric_limits<double>::max());
    out.normal = polytope.normal(on.face);
    const MinkowskiDifference::Point further = minkowski.furthest(out.normal);
    out.distance = -dot(out.normal, further.difference);
    if (isRound || !grow(further, -out.distance, on.from.distance)) break;
  }
  PALPATE_ASSERT(pointsOfA.size() == polytope.points().size());
  Vector3d point = m_p0;
  for (int i = 0; i < 3; ++i)
    point += on.from.weights[i] * pointsOfA[polytope.corners(on.face)[static_cast<std::size_t>(i)]];
  const Vector3d normal = -out.normal;
  return {point - m_radius * normal, point + on.from.difference + other.m_radius * normal, normal,
          out.distance - m_radius - other.m_radius};
}

/// The distance of this capsule from another one, or of this sphere from a body.
ShapePairDistance Shape::axisDistance(const Shape& body) const {
  PALPATE_ASSERT(m_type == Type::Capsule && (m_p0 == m_p1 || body.m_type == Type::Capsule));
  NearestToShape nearest{Vector3d::UnitX(), {}, 0, false};
  if (body.m_type == Type::Capsule) {
    nearest = body.nearestOfEdge(m_p0, m_p1);
  } else {
    const PointShapeDistance at = body.signedDistance(m_p0);
    nearest.normal = at.normal;
    nearest.distance = at.distance;
  }
  const Vector3d point = m_p0 + nearest.weights[1] * (m_p1 - m_p0) - m_radius * nearest.normal;
  const double distance = nearest.distance - m_radius;
  return {point, point - distance * nearest.normal, nearest.normal, distance};
}

bool Shape::needsMinkowskiDifference(const Shape& b) const {
  const auto isSphere = [](const Shape& s) {
    return s.m_type == Type::Capsule && s.m_p0 == s.m_p1;
  };
  if (isPlane() || b.isPlane() || isSphere(*this) || isSphere(b)) return false;
  return m_type != Type::Capsule || b.m_type != Type::Capsule;
}

double Shape::size() const {
  if (isPlane()) return std::numeric_limits<double>::infinity();
  double longest = 0;
  for (const Vector3d& p : m_corners) longest = std::max(longest, largest(p - m_corners.front()));
  return longest + radius();
}

ShapePairDistance Shape::distanceFrom(const Shape& b, ShapePairScratch& scratch) const {
  PALPATE_ASSERT(!isPlane() || !b.isPlane());
  if (b.precedes(*this)) return b.distanceFrom(*this, scratch).exchanged();
  if (isPlane()) return planeDistance(b);
  if (m_type == Type::Capsule && b.m_type == Type::Capsule && b.m_p0 == b.m_p1)
    return b.axisDistance(*this).exchanged();
  if (m_type == Type::Capsule && (b.m_type == Type::Capsule || m_p0 == m_p1))
    return axisDistance(b);
  return minkowskiDistance(b, scratch);
}

}  // namespace palpate
