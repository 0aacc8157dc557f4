#include "Shapes/ShapeStep.h"

#include "Shapes/ShapeLengths.h"
#include "Math/Tolerances.h"
#include "Exact/Compensated.h"
#include "Core/Assert.h"

#include <algorithm>
#include <limits>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// u x v, in Bernstein form.
template <class Moment>
std::array<Vector3d, 3> normalsOf(const Moment& a, const Moment& b) {
  return {a.u.cross(a.v), 0.5 * (a.u.cross(b.v) + b.u.cross(a.v)), b.u.cross(b.v)};
}

/// normal . from, in Bernstein form.
template <class Moment>
std::array<double, 4> heightsOf(const std::array<Vector3d, 3>& n, const Moment& a,
                                const Moment& b) {
  return {n[0].dot(a.from), (n[0].dot(b.from) + 2 * n[1].dot(a.from)) / 3,
          (2 * n[1].dot(b.from) + n[2].dot(a.from)) / 3, n[2].dot(b.from)};
}

/// Whether all heights are above a bound; with `either`, also whether all are below the negative
/// bound.
template <std::size_t size>
bool areBeyond(const std::array<double, size>& heights, double bound, bool either) {
  const auto [least, most] = std::minmax_element(heights.begin(), heights.end());
  return *least > bound || (either && *most < -bound);
}

}  // namespace

MovingBody movingBody(const Shape& before, const Shape& now) {
  PALPATE_ASSERT(!before.isPlane() && before.corners().size() == now.corners().size());
  MovingBody body{{before.corners(), now.corners()}};
  (before.isCylinder() ? body.cylinderRadius : body.radius) = before.radius();
  return body;
}

ShapeStep::Moment ShapeStep::at(const Shape& shape, const Vector3d& point) {
  PALPATE_ASSERT(!shape.hasCorners());
  const Vector3d from = point - shape.origin();
  if (shape.isPlane()) return {from, shape.axes().col(0), shape.axes().col(1)};
  return {from, shape.corners()[1] - shape.corners()[0], Vector3d::Zero()};
}

ShapeStep::Moment ShapeStep::between(const Moment& a, const Moment& b, double time) {
  const double left = 1.0 - time;
  return {left * a.from + time * b.from, left * a.u + time * b.u, left * a.v + time * b.v};
}

ShapeStep::Moment ShapeStep::scaledBy(int exponent, const Moment& moment) const {
  if (exponent == 0) return moment;
  if (m_before.isPlane()) return {scaled(moment.from, exponent), moment.u, moment.v};
  return {scaled(moment.from, exponent), scaled(moment.u, exponent), moment.v};
}

bool ShapeStep::staysAbove(const Moment& a, const Moment& b, const ScaledLengths& lengths) const {
  const std::array<Vector3d, 3> n = normalsOf(a, b);
  const double length =
      std::sqrt(std::max({n[0].squaredNorm(), n[1].squaredNorm(), n[2].squaredNorm()}));
  return areBeyond(heightsOf(n, a, b), lengths.distance * length + lengths.error,
                   m_before.isTwoSided());
}

bool ShapeStep::staysOutside(const Moment& a, const Moment& b, const ScaledLengths& lengths) const {
  const auto& [exponent, distance, error, radius] = lengths;
  const double reach = radius + distance;
  const std::array<double, 3> squares{a.u.squaredNorm(), a.u.dot(b.u), b.u.squaredNorm()};
  const double longest = std::max(squares[0], squares[2]),
               furthest = std::sqrt(std::max(a.from.squaredNorm(), b.from.squaredNorm()));
  // The cylinder is in a ball about its centre.
  const double half = 0.5 * (b.from - a.from).norm();
  if ((0.5 * (a.from + b.from)).norm() - half >
      distance + std::hypot(radius, 0.5 * std::sqrt(longest)) + error)
    return true;
  // Beyond an end: the polynomial is from . u less half the square of u.
  const std::array<double, 3> along{a.from.dot(a.u), 0.5 * (a.from.dot(b.u) + b.from.dot(a.u)),
                                    b.from.dot(b.u)};
  const double needed = std::sqrt(longest) * (distance + error);
  for (const double side : {1.0, -1.0}) {
    std::array<double, 3> beyond;
    for (int i = 0; i < 3; ++i) beyond[i] = side * along[i] - 0.5 * squares[i];
    if (areBeyond(beyond, needed, false)) return true;
  }
  // Beyond the lateral surface: the polynomial is the square of from x u less that of the reach
  // times u.
  const Vector3d k0 = a.from.cross(a.u), k1 = 0.5 * (a.from.cross(b.u) + b.from.cross(a.u)),
                 k2 = b.from.cross(b.u);
  const auto& [q0, q1, q2] = squares;
  const double square = reach * reach;
  const std::array<double, 5> across{
      k0.dot(k0) - square * q0, k0.dot(k1) - square * (q0 + q1) / 2,
      (k0.dot(k2) + 2 * k1.dot(k1)) / 3 - square * (q0 + 4 * q1 + q2) / 6,
      k1.dot(k2) - square * (q1 + q2) / 2, k2.dot(k2) - square * q2};
  return areBeyond(across, error * (furthest + reach) * longest, false) || staysFar(a, b, lengths);
}

/// Whether the point, at half time, is further from the cylinder than both can move until the ends
/// of the part. From its state at half time, the cylinder gets to any other by turning about its
/// centre and growing along its axis.
bool ShapeStep::staysFar(const Moment& a, const Moment& b, const ScaledLengths& lengths) const {
  const Moment middle = between(a, b, 0.5);
  const Vector3d along = middle.u.normalized();
  const double chord =
      std::max((a.u.normalized() - along).norm(), (b.u.normalized() - along).norm());
  if (!(chord < 1)) return false;  // also if an axis has no direction; then only the ball decides
  const double motion = 0.5 * (b.from - a.from).norm() + 0.25 * (b.u - a.u).norm() +
                        chord * std::hypot(lengths.radius, 0.5 * middle.u.norm());
  const double middleDistance =
      std::ldexp(distanceAt(scaledBy(-lengths.exponent, middle)).distance, lengths.exponent);
  return middleDistance - motion > lengths.distance + lengths.error;
}

PointShapeDistance ShapeStep::distanceAt(const Moment& moment) const {
  if (m_before.isPlane()) {
    const Vector3d normal = moment.u.cross(moment.v).stableNormalized();
    return {normal.dot(moment.from), normal};
  }
  return m_before.distanceFromCylinder(moment.from, moment.u);
}

std::optional<double> ShapeStep::firstTimeWithin(const Point& point, double distance,
                                                 double tolerance) const {
  const double size =
      m_before.magnitude() + m_now.magnitude() + largest(point[0]) + largest(point[1]) + distance;
  const int exponent = isModerate(size) ? 0 : exponentTowardsOne(size);
  const auto scaledLength = [&](double length) { return std::ldexp(length, exponent); };
  const ScaledLengths lengths{exponent, scaledLength(distance),
                              kShapeBoundError * scaledLength(size),
                              scaledLength(m_before.radius())};
  const Moment start = scaledBy(exponent, before(point[0])),
               end = scaledBy(exponent, now(point[1]));
  const auto isExcluded = [&](double from, double to) {
    const Moment a = between(start, end, from), b = between(start, end, to);
    return m_before.isPlane() ? staysAbove(a, b, lengths) : staysOutside(a, b, lengths);
  };
  return firstTimeNotExcluded(tolerance, isExcluded);
}

/// The side of a two-sided plane on which a body is before the step. For a half-space, always the
/// outside.
double ShapeStep::sideOf(const MovingBody& body) const {
  return m_before.isTwoSided() && distanceAt(before(body.corners[0][0])).distance < 0 ? -1.0 : 1.0;
}

std::optional<double> ShapeStep::firstTimeWithin(const MovingBody& body, double distance,
                                                 double tolerance) const {
  PALPATE_ASSERT(m_before.isPlane() && !body.corners[0].empty());
  double size = 0;
  for (const auto& corners : body.corners)
    for (const Vector3d& p : corners) size = std::max(size, largest(p));
  size += m_before.magnitude() + m_now.magnitude() + (distance + body.radius + body.cylinderRadius);
  const int exponent = isModerate(size) ? 0 : exponentTowardsOne(size);
  const double side = sideOf(body), cylinderRadius = std::ldexp(body.cylinderRadius, exponent),
               needed = std::ldexp(distance + body.radius, exponent),
               error = kShapeBoundError * std::ldexp(size, exponent);
  const auto momentOf = [&](std::size_t i, double time) {
    return between(scaledBy(exponent, before(body.corners[0][i])),
                   scaledBy(exponent, now(body.corners[1][i])), time);
  };
  return firstTimeNotExcluded(tolerance, [&](double from, double to) {
    const Moment first = momentOf(0, from), last = momentOf(0, to);
    const std::array<Vector3d, 3> n = normalsOf(first, last);
    const double length =
        std::sqrt(std::max({n[0].squaredNorm(), n[1].squaredNorm(), n[2].squaredNorm()}));
    double bound = needed * length + error;
    if (cylinderRadius > 0) {
      // The lateral surface reaches as far as its radius times the sine of the angle between normal
      // and axis, times the normal's length.
      const Vector3d start = momentOf(1, from).from - first.from,
                     end = momentOf(1, to).from - last.from;
      const double shortest = 0.5 * (start + end).norm() - 0.5 * (end - start).norm();
      const double across =
          std::sqrt(std::max({n[0].cross(start).squaredNorm(),
                              ((n[0].cross(end) + 2 * n[1].cross(start)) / 3).squaredNorm(),
                              ((2 * n[1].cross(end) + n[2].cross(start)) / 3).squaredNorm(),
                              n[2].cross(end).squaredNorm()}));
      bound += cylinderRadius * (across < length * shortest ? across / shortest : length);
    }
    for (std::size_t i = 0; i < body.corners[0].size(); ++i)
      for (const double height : heightsOf(n, momentOf(i, from), momentOf(i, to)))
        if (!(side * height > bound)) return false;
    return true;
  });
}

ShapePairDistance ShapeStep::nearestAt(const MovingBody& body, double time) const {
  PALPATE_ASSERT(m_before.isPlane() && time >= 0.0 && time <= 1.0);
  const auto momentOf = [&](std::size_t i) {
    return between(before(body.corners[0][i]), now(body.corners[1][i]), time);
  };
  const Moment any = momentOf(0);
  Vector3d normal = distanceAt(any).normal;
  if (normal == Vector3d::Zero()) normal = m_before.axes().col(2);
  normal *= sideOf(body);
  const double tie = kOnSurface * (m_before.magnitude() + m_now.magnitude());
  double lowest = std::numeric_limits<double>::infinity(), count = 0;
  for (std::size_t i = 0; i < body.corners[0].size(); ++i)
    lowest = std::min(lowest, dot(normal, momentOf(i).from));
  Vector3d nearest = Vector3d::Zero();
  for (std::size_t i = 0; i < body.corners[0].size(); ++i) {
    const Vector3d from = momentOf(i).from;
    if (dot(normal, from) <= lowest + tie) nearest += from, ++count;
  }
  nearest /= count;
  if (body.cylinderRadius > 0) {
    const Vector3d axis = directionOf(momentOf(1).from - any.from);
    const LengthAndDirection across = polar(dot(normal, axis) * axis - normal);
    if (across.length * body.cylinderRadius > 0.5 * tie)
      nearest += body.cylinderRadius * across.direction;
  }
  const double distance = dot(normal, nearest) - body.radius;
  const Vector3d point =
      nearest - body.radius * normal + ((1.0 - time) * m_before.origin() + time * m_now.origin());
  return {point - distance * normal, point, -normal, distance};
}

PointShapeDistance ShapeStep::signedDistanceAt(const Point& point, double time) const {
  const Moment start = before(point[0]), atTime = between(start, now(point[1]), time);
  PointShapeDistance nearest = distanceAt(atTime);
  if (m_before.isPlane() && nearest.normal == Vector3d::Zero())
    nearest.normal = m_before.axes().col(2);
  if (m_before.isTwoSided() && distanceAt(start).distance < 0)
    nearest = {-nearest.distance, -nearest.normal};
  return nearest;
}

bool ShapeStep::mayComeNear(const Eigen::AlignedBox3d& box, double distance) const {
  PALPATE_ASSERT(m_before.isPlane() && !box.isEmpty());
  const Vector3d centre = box.center();
  const Moment start = before(centre), end = now(centre);
  const std::array<Vector3d, 3> n = normalsOf(start, end);
  double extent = 0;
  for (const Vector3d& normal : n)
    extent = std::max(extent, 0.5 * normal.cwiseAbs().dot(box.sizes()));
  // What firstTimeWithin() allows a point that has the largest coordinates at both ends, and the
  // roundings here.
  const double size = m_before.magnitude() + m_now.magnitude() +
                      2.0 * std::max(largest(box.min()), largest(box.max())) + distance;
  const double error = 2.0 * kShapeBoundError * size;
  return !areBeyond(heightsOf(n, start, end), distance + extent + error, m_before.isTwoSided());
}

}  // namespace palpate
