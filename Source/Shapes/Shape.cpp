#include "Shapes/Shape.h"

#include "Shapes/ShapeLengths.h"
#include "Mesh/Rotation.h"
#include "Math/ClosestPoint.h"
#include "Math/Foot.h"
#include "Math/Range.h"
#include "Math/Tolerances.h"
#include "Exact/Compensated.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"
#include "Core/Text.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// A rotation that turns z into the direction.
Eigen::Matrix3d axesAlong(const Vector3d& direction) {
  const Vector3d z = directionOf(direction), x = z.unitOrthogonal();
  Eigen::Matrix3d axes;
  axes << x, z.cross(x), z;
  return axes;
}

/// The corners of a box or a hull, relative to its origin; empty for other shapes.
std::vector<Vector3d> cornersOf(const AnalyticalGeometry& geometry) {
  if (const auto* hull = std::get_if<ConvexHull>(&geometry)) return hull->points;
  std::vector<Vector3d> corners;
  if (const auto* box = std::get_if<Box>(&geometry))
    for (int v = 0; v < 8; ++v)
      corners.push_back(
          Vector3d(v & 1 ? 1 : -1, v & 2 ? 1 : -1, v & 4 ? 1 : -1).cwiseProduct(box->halfExtents));
  return corners;
}

}  // namespace

Eigen::Matrix3d orthonormal(const Eigen::Matrix3d& rotation) {
  Eigen::Matrix3d axes;
  const Vector3d x = rotation.col(0).normalized();
  axes << x, (rotation.col(1) - x.dot(rotation.col(1)) * x).normalized(), Vector3d::Zero();
  axes.col(2) = x.cross(axes.col(1));
  return axes;
}

Shape::Shape(const AnalyticalGeometry& geometry, const Pose& transform) {
  if (const std::vector<Vector3d> corners = cornersOf(geometry); !corners.empty()) {
    m_span = spanOf(corners);
    if (m_span.size() > 2) m_hull = std::make_shared<Polytope>(corners);
  }
  if (m_hull) {
    for (std::uint32_t f = 0; f < m_hull->faceCount(); ++f) {
      m_faces.push_back(m_hull->corners(f));
      const auto& [a, b, c] = m_faces.back();
      for (const auto& edge : {Segment{a, b}, Segment{b, c}, Segment{c, a}})
        if (edge[0] < edge[1]) m_edges.push_back(edge);  // two faces share it, one each way
    }
  } else {
    m_faces = {{0, 1, 1}};
    m_edges = {{0, 1}};
  }
  place(geometry, transform);
}

void Shape::place(const AnalyticalGeometry& geometry, const Pose& transform) {
  PALPATE_ASSERT(deviationFromRotation(transform.rotation) <= kRoughRotation);
  PALPATE_ASSERT(!m_span.empty() ==
                 (std::get_if<Box>(&geometry) || std::get_if<ConvexHull>(&geometry)));
  const auto capsule = [&](const Vector3d& p0, const Vector3d& p1, double radius) {
    m_type = Type::Capsule;
    m_p0 = transform(p0);
    m_p1 = transform(p1);
    m_radius = radius;
    const Vector3d along = m_p1 - m_p0;
    const double square = along.squaredNorm();
    m_axisSquare = isInRange(square) ? square : along == Vector3d::Zero() ? 0.0 : -1.0;
  };
  const auto body = [&](Type type, const Vector3d& origin, const Eigen::Matrix3d& axes,
                        const std::array<double, 2>& sizes) {
    m_type = type;
    m_p0 = m_p1 = transform(origin);
    m_axes = orthonormal(transform.rotation) * axes;
    m_sizes = sizes;
  };
  if (const auto* sphere = std::get_if<Sphere>(&geometry)) {
    capsule(sphere->centre, sphere->centre, sphere->radius);
  } else if (const auto* rod = std::get_if<Capsule>(&geometry)) {
    capsule(rod->p0, rod->p1, rod->radius);
  } else if (const auto* plane = std::get_if<Plane>(&geometry)) {
    body(plane->twoSided ? Type::TwoSidedPlane : Type::Plane, plane->point,
         axesAlong(plane->normal), {});
  } else if (const auto* cylinder = std::get_if<Cylinder>(&geometry)) {
    if (cylinder->radius > 0) {
      const Vector3d axis = cylinder->p1 - cylinder->p0;
      body(Type::Cylinder, cylinder->p0 + 0.5 * axis, axesAlong(axis),
           {cylinder->radius, 0.5 * lengthOf(axis)});
    } else {
      capsule(cylinder->p0, cylinder->p1, 0);
    }
  } else {
    const auto* box = std::get_if<Box>(&geometry);
    const Vector3d origin = box ? box->centre : Vector3d(Vector3d::Zero());
    if (m_hull)
      body(Type::Hull, origin, Eigen::Matrix3d::Identity(), {});
    else
      capsule(origin + m_span.front(), origin + m_span.back(), 0);
  }
  placeCorners();
}

Eigen::AlignedBox3d Shape::bounds() const {
  Vector3d margin =
      Vector3d::Constant(isPlane() ? std::numeric_limits<double>::infinity() : m_radius);
  if (isCylinder())
    for (int k = 0; k < 3; ++k) {
      // A disc reaches its radius times the sine of the angle between its axis and the coordinate
      // axis.
      const double cosine = m_axes(k, 2);
      margin[k] = m_sizes[0] * std::sqrt(std::max(0.0, (1.0 - cosine) * (1.0 + cosine)));
    }
  Eigen::AlignedBox3d box;
  for (const Vector3d& corner : m_corners) box.extend(corner);
  return {box.min() - margin, box.max() + margin};
}

void Shape::translate(const Vector3d& shift) {
  m_p0 += shift;
  m_p1 += shift;
  placeCorners();
}

void Shape::placeBetween(const Shape& before, const Shape& now, double time) {
  PALPATE_ASSERT(before.isCylinder() && now.isCylinder());
  PALPATE_ASSERT(time >= 0.0 && time <= 1.0);
  const auto at = [&](std::size_t end) -> Vector3d {
    return (1.0 - time) * before.m_corners[end] + time * now.m_corners[end];
  };
  const Vector3d axis = at(1) - at(0);
  m_type = Type::Cylinder;
  m_p0 = m_p1 = at(0) + 0.5 * axis;
  m_axes = axis == Vector3d::Zero() ? before.m_axes : axesAlong(axis);
  m_sizes = {before.m_sizes[0], 0.5 * lengthOf(axis)};
  placeCorners();
}

void Shape::placeCorners() {
  m_corners = {m_p0, m_p1};
  if (isCylinder()) {
    m_corners = {m_p0 - m_sizes[1] * m_axes.col(2), m_p0 + m_sizes[1] * m_axes.col(2)};
  } else if (m_hull) {
    m_corners = m_hull->points();
    for (Vector3d& p : m_corners) p = m_p0 + m_axes * p;
  }
  m_magnitude = largest(m_p0);
  for (const Vector3d& p : m_corners) m_magnitude = std::max(m_magnitude, largest(p));
  m_magnitude += largest(m_p0) + radius();
}

Vector3d Shape::inBody(const Vector3d& x) const { return m_axes.transpose() * (x - m_p0); }

Shape::Components Shape::componentsOf(const Vector3d& v, double tie) const {
  PALPATE_ASSERT(tie >= 0.0);
  const auto& [radius, across] = polar({v[0], v[1], 0});
  const Vector3d outward = radius > 0 ? across : Vector3d(1, 0, 0);
  return {{radius, std::abs(v[2])}, {outward, Vector3d(0, 0, v[2] < -tie ? -1 : 1)}};
}

PointShapeDistance Shape::atBody(const Vector3d& u, double tie) const {
  if (m_hull) return m_hull->signedDistance(u, tie);
  if (isPlane()) {
    const bool below = m_type == Type::TwoSidedPlane && u[2] < 0;
    return {below ? -u[2] : u[2], {0, 0, m_type == Type::TwoSidedPlane && u[2] < -tie ? -1. : 1.}};
  }
  return atBody(u, tie, m_sizes);
}

PointShapeDistance Shape::atBody(const Vector3d& u, double tie,
                                 const std::array<double, 2>& sizes) const {
  const Components components = componentsOf(u, tie);
  const std::array<double, 2> beyond{components.lengths[0] - sizes[0],
                                     components.lengths[1] - sizes[1]};
  if (std::min(beyond[0], beyond[1]) > kOnSurface * m_magnitude) {
    const auto [distance, normal] =
        polar(beyond[0] * components.directions[0] + beyond[1] * components.directions[1]);
    return {distance, normal};
  }
  const std::size_t nearest = beyond[1] > beyond[0] + tie;
  return {beyond[nearest], components.directions[nearest]};
}

PointShapeDistance Shape::leastAtBody(const Vector3d& u, std::span<const Vector3d> sides) const {
  double tie = kOnSurface * m_magnitude;
  for (const Vector3d& side : sides) tie += 2 * kEdgeWeight * largest(side);
  if (m_hull) return m_hull->leastDistance(u, sides, tie);
  PointShapeDistance least = atBody(u, tie);
  if (!isCylinder() || least.distance > tie) return least;
  const Components components = componentsOf(u, tie);
  const auto& [lengths, directions] = components;
  if (std::abs((lengths[0] - m_sizes[0]) - (lengths[1] - m_sizes[1])) <= tie)
    least.normal = directions[riseOf(sides, directions[1]) < riseOf(sides, directions[0]) ? 1 : 0];
  return least;
}

PointShapeDistance Shape::distanceFromCylinder(const Vector3d& fromCentre,
                                               const Vector3d& axis) const {
  PALPATE_ASSERT(isCylinder());
  const Eigen::Matrix3d axes = axis == Vector3d::Zero() ? m_axes : axesAlong(axis);
  const PointShapeDistance inBodyFrame = atBody(
      axes.transpose() * fromCentre, kOnSurface * m_magnitude, {m_sizes[0], 0.5 * lengthOf(axis)});
  return {inBodyFrame.distance, axes * inBodyFrame.normal};
}

PointShapeDistance Shape::signedDistance(const Vector3d& x) const {
  if (m_type != Type::Capsule) {
    const PointShapeDistance inBodyFrame = atBody(inBody(x), kOnSurface * m_magnitude);
    return {inBodyFrame.distance, m_axes * inBodyFrame.normal};
  }
  const Vector3d along = m_p1 - m_p0, from = x - m_p0;
  double weight = 0;
  if (m_axisSquare != 0) {
    const double product = from.dot(along);
    weight = m_axisSquare > 0 && std::abs(product) < kOverflowGuard
                 ? std::clamp(product / m_axisSquare, 0.0, 1.0)
                 : weightOnAnyAxis(from, along);
  }
  const auto& [distance, outward] = polar(from - weight * along);
  const bool onAxis = distance <= kOnSurface * m_magnitude;
  return {distance - m_radius,
          onAxis ? directionFromAxis(axisOfLeastComponent(along.cwiseAbs())) : outward};
}

Vector3d Shape::directionFromAxis(const Vector3d& normal) const {
  PALPATE_ASSERT(m_type == Type::Capsule);
  const Vector3d along = directionOf(m_p1 - m_p0);
  const Vector3d across = normal - along.dot(normal) * along;
  return across.squaredNorm() > kAcrossSquare ? across.normalized() : along.unitOrthogonal();
}

/// Where an edge turns from falling to rising that is nearest to the lateral surface of a cylinder
/// in all its points. Further away than `error` from there, the sign of the slope is certain,
/// however rounded. NaN if the edge is not such, or if squares of its lengths lose bits.
Shape::Turn Shape::turnBesideAxis(const Vector3d& from, const Vector3d& along) const {
  const Turn unknown{std::numeric_limits<double>::quiet_NaN(), 0.0};
  if (!isCylinder()) return unknown;
  const double square = along[0] * along[0] + along[1] * along[1],
               start = from[0] * from[0] + from[1] * from[1];
  if (!(square > 0x1p-900 && square < 0x1p900 && start < 0x1p900)) return unknown;
  const double at = -(from[0] * along[0] + from[1] * along[1]) / square,
               t = std::clamp(at, 0.0, 1.0);
  const double least = std::hypot(from[0] + t * along[0], from[1] + t * along[1]) - m_sizes[0],
               ends = std::max(std::abs(from[2]), std::abs(from[2] + along[2])) - m_sizes[1];
  if (!(ends < std::min(0.0, least) - kOnSurface * m_magnitude)) return unknown;
  return {at, kTurnError * (1.0 + std::sqrt(start / square))};
}

NearestToShape Shape::nearestOfEdge(const Vector3d& p, const Vector3d& q) const {
  if (m_type == Type::Capsule) {
    const EdgeEdgeDistance axis = finiteEdgeEdgeDistance(p, q, m_p0, m_p1);
    return {{1.0 - axis.weightA, axis.weightA, 0.0},
            axis.distance > kOnSurface * m_magnitude ? axis.normal : directionFromAxis(axis.normal),
            axis.distance - m_radius,
            axis.featureA == EdgeFeature::Interior,
            axis.exact};
  }
  if (m_type == Type::TwoSidedPlane) {
    const double start = inBody(p)[2], end = inBody(q)[2];
    if ((start < 0 && end > 0) || (start > 0 && end < 0)) {
      const double t = start / (start - end);
      return {{1.0 - t, t, 0.0}, m_axes.col(2), 0.0, true};
    }
  }
  const Vector3d from = inBody(p), along = inBody(q) - from;
  // Over a cylinder's flat end, rounding is no slope.
  const bool isLevel = isCylinder() && std::abs(along[2]) <= kOnSurface * m_magnitude;
  const Turn turn = turnBesideAxis(from, along);
  // Its sign is right; the value may be another one.
  const auto slope = [&](double t) {
    if (t < turn.at - turn.error) return -1.0;
    if (t > turn.at + turn.error) return 1.0;
    const Vector3d normal = atBody(from + t * along, 0).normal;
    return isLevel && std::abs(normal[2]) == 1.0 ? 0.0 : normal.dot(along);
  };
  const auto at = [&](double t, bool inInterior) {
    const Vector3d u = from + t * along;
    const PointShapeDistance least =
        inInterior ? leastAtBody(u, {&along, 1}) : atBody(u, kOnSurface * m_magnitude);
    return NearestToShape{{1.0 - t, t, 0.0}, m_axes * least.normal, least.distance, inInterior};
  };
  if (m_hull) {
    const double t = m_hull->leastOnEdge(from, from + along, kOnSurface * m_magnitude);
    return at(t, t > 0 && t < 1);
  }
  // The distance is convex along the edge. Its minimum is where the slope changes sign.
  if (slope(0) >= 0) return at(0, false);
  if (slope(1) <= 0) return at(1, false);
  // Finds where the slope turns from falling to rising. An interval without slope is bracketed from
  // both sides.
  const auto bracket = [&](auto&& isBefore) {
    double low = 0, high = 1;
    while (high - low > kEdgeWeight) {
      const double middle = 0.5 * (low + high);
      (isBefore(slope(middle)) ? low : high) = middle;
    }
    return 0.5 * (low + high);
  };
  const double first = bracket([](double s) { return s < 0; });
  const double last =
      slope(first + 2 * kEdgeWeight) > 0 ? first : bracket([](double s) { return !(s > 0); });
  const double t = 0.5 * (first + last);
  if (first <= kEdgeWeight) return at(0, false);
  if (last >= 1 - kEdgeWeight) return at(1, false);
  return at(t, true);
}

/// For a cylinder and the plane normal . u = height, with height not negative: the plane's point
/// that is deepest in the shape, or the shape's point nearest to the plane. The shape shrunk by m
/// on all sides, { u: distance <= -m }, has the components' sizes less m. m is the largest value
/// for which it still reaches the plane. supportHeight: of the plane that touches the shape.
Vector3d Shape::nearestOfPlane(const Vector3d& normal, double height, double& supportHeight) const {
  PALPATE_ASSERT(isCylinder() && height >= 0.0);
  const Components components = componentsOf(normal, 0);
  const auto& [lengths, directions] = components;
  supportHeight = lengths[0] * m_sizes[0] + lengths[1] * m_sizes[1];
  const double all = lengths[0] + lengths[1], deepest = -std::min(m_sizes[0], m_sizes[1]);
  const double level = std::min(0.0, std::max(deepest, (height - supportHeight) / all));
  Vector3d point = Vector3d::Zero();
  for (int i = 0; i < 2; ++i)
    if (lengths[i] * m_sizes[i] > kOnSurface * m_magnitude)
      point += (m_sizes[i] + level) * directions[i];
  const double pointHeight = supportHeight + level * all;
  return pointHeight > height ? Vector3d(height / pointHeight * point) : point;
}

/// nearestInTriangle() for a capsule.
std::optional<NearestToShape> Shape::nearestToAxis(const Vector3d& a, const Vector3d& b,
                                                   const Vector3d& c) const {
  const VertexTriangleDistance ends[] = {finiteVertexTriangleDistance(m_p0, a, b, c),
                                         finiteVertexTriangleDistance(m_p1, a, b, c)};
  const Vector3d along = m_p1 - m_p0;
  const auto answer = [&](const VertexTriangleDistance& end, double distance) {
    const bool onAxis = distance <= kOnSurface * m_magnitude;
    return NearestToShape{end.weights,
                          onAxis ? directionFromAxis(-end.normal) : Vector3d(-end.normal),
                          distance - m_radius, true, end.exact};
  };
  const auto projectsOntoFace = [&](int i) { return ends[i].feature == TriangleFeature::Face; };
  if (projectsOntoFace(0) && projectsOntoFace(1) &&
      signedDot(ends[0].difference, ends[1].difference) > 0) {
    if (ends[0].distance != ends[1].distance)
      return answer(ends[ends[1].distance < ends[0].distance],
                    std::min(ends[0].distance, ends[1].distance));
    return answer(finiteVertexTriangleDistance(m_p0 + 0.5 * along, a, b, c), ends[0].distance);
  }
  for (const int i : {0, 1})  // this end is nearest if the axis does not come nearer from it
    if (projectsOntoFace(i) && (i == 0 ? 1 : -1) * signedDot(along, ends[i].difference) >= 0)
      return answer(ends[i], ends[i].distance);
  SignCounts counts;
  const OrientedPlane plane(a, b, c);
  const int side = plane.side(m_p0, counts), turn = orient3d(m_p0, m_p1, a, b, counts);
  if (side == 0 || turn == 0 || side != -plane.side(m_p1, counts) ||
      turn != orient3d(m_p0, m_p1, b, c, counts) || turn != orient3d(m_p0, m_p1, c, a, counts))
    return {};
  const Vector3d normal = unitCross(a, b, a, c);
  const double before = std::abs(normal.dot(m_p0 - a)), after = std::abs(normal.dot(m_p1 - a));
  const double t = before > 0 ? before / (before + after) : 0.0;
  VertexTriangleDistance through = finiteVertexTriangleDistance(m_p0 + t * along, a, b, c);
  through.normal = normal;
  return answer(through, 0.0);
}

std::optional<NearestToShape> Shape::nearestInTriangle(const Vector3d& a, const Vector3d& b,
                                                       const Vector3d& c) const {
  if (m_type == Type::Capsule) return nearestToAxis(a, b, c);
  if (m_hull) return nearestToHull(inBody(a), inBody(b), inBody(c));
  Vector3d normal = unitCross(a, b, a, c);
  // In a half-space, no interior point of a triangle is deeper than all of its boundary.
  if (m_type < Type::Capsule || normal == Vector3d::Zero()) return {};
  double height = normal.dot(a - m_p0);
  if (height < 0) normal = -normal, height = -height;
  double reach = 0;
  const Vector3d point = m_p0 + m_axes * nearestOfPlane(m_axes.transpose() * normal, height, reach);
  const VertexTriangleDistance on = finiteVertexTriangleDistance(point, a, b, c);
  if (on.feature != TriangleFeature::Face) return {};
  const Vector3d& weights = on.weights;
  if (height > reach - kOnSurface * m_magnitude)  // the point is the shape's nearest to the plane
    return NearestToShape{weights, normal, on.distance, true};
  const Vector3d sides[] = {m_axes.transpose() * (b - a), m_axes.transpose() * (c - a)};
  const PointShapeDistance least =
      leastAtBody(inBody(weights[0] * a + weights[1] * b + weights[2] * c), sides);
  return NearestToShape{weights, m_axes * least.normal, least.distance, true};
}

/// nearestInTriangle() for a hull. The triangle is in the body's frame.
std::optional<NearestToShape> Shape::nearestToHull(const Vector3d& a, const Vector3d& b,
                                                   const Vector3d& c) const {
  const double tie = kOnSurface * m_magnitude;
  const Vector3d up = unitCross(a, b, a, c);
  if (up == Vector3d::Zero()) return {};
  for (const Vector3d& normal : {up, Vector3d(-up)}) {
    const Vector3d point = m_hull->support(normal, tie);
    if (normal.dot(a - point) < -tie) continue;  // the plane goes through
    const VertexTriangleDistance on = finiteVertexTriangleDistance(point, a, b, c);
    if (on.feature != TriangleFeature::Face) return {};
    return NearestToShape{on.weights, m_axes * normal, on.distance, true, on.exact};
  }
  const std::optional<Vector3d> weights = m_hull->leastInTriangle(a, b, c, tie);
  if (!weights) return {};
  const Vector3d sides[] = {b - a, c - a};
  const PointShapeDistance least =
      leastAtBody((*weights)[0] * a + (*weights)[1] * b + (*weights)[2] * c, sides);
  return NearestToShape{*weights, m_axes * least.normal, least.distance, true};
}

std::string faultOf(const AnalyticalGeometry& geometry, std::optional<std::size_t>& element) {
  std::string fault;
  constexpr const char* kWithin = "at most 1e+300 in magnitude";
  const auto isBeyond = [](const Vector3d& v) { return largest(v) > kLargestMeasure; };
  const auto report = [&](const std::string& name, const auto& value, const char* rule) {
    fault = name + " is " + textOf(value) + "; it must be " + rule;
  };
  forEachField(geometry, [&](const std::string& name, const auto& field) {
    using Field = std::decay_t<decltype(field)>;
    if constexpr (std::is_same_v<Field, std::vector<Vector3d>>) {
      if (field.empty()) fault = "the hull has no points; it needs at least one";
      for (std::size_t i = field.size(); i-- > 0;)
        if (const bool finite = field[i].allFinite(); !finite || isBeyond(field[i]))
          report("point " + std::to_string(i), field[i], finite ? kWithin : "finite"), element = i;
      if (field.size() > kMaxHullPoints)
        fault = "the hull has " + std::to_string(field.size()) + " points; it must have at most " +
                std::to_string(kMaxHullPoints);
    } else if constexpr (!std::is_same_v<Field, bool>) {
      Vector3d values;
      values << field, Eigen::VectorXd::Zero(std::is_same_v<Field, double> ? 2 : 0);
      const bool isSize = name == "radius" || name == "halfExtents";
      if (!values.allFinite() || (isSize && !(values.minCoeff() >= 0)))
        report(name, field, isSize ? "finite and not negative" : "finite");
      else if (name == "normal" ? values == Vector3d::Zero() : isBeyond(values))
        report(name, field, name == "normal" ? "longer than zero" : kWithin);
    }
  });
  const auto* cylinder = std::get_if<Cylinder>(&geometry);
  if (fault.empty() && cylinder && cylinder->p0 == cylinder->p1)
    report("p1", cylinder->p1, "different from p0");
  return fault;
}

std::string faultOf(const Pose& transform) {
  const Eigen::Matrix3d& r = transform.rotation;
  const double off = deviationFromRotation(r);
  if (!r.allFinite()) return "rotation has an entry that is not finite";
  if (!(off <= kRoughRotation) || !(r.determinant() > 0))
    return "rotation is not a rotation matrix: R^T R differs from the identity by " + textOf(off) +
           ", at most 1e-05 is allowed, and its determinant is " + textOf(r.determinant());
  if (isWithinRange(transform.translation)) return {};
  return "translation is " + textOf(transform.translation) + "; it must be " + kRangeRule;
}

}  // namespace palpate
