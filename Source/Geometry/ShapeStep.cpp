#include "Geometry/ShapeStep.h"

#include "Math/Compensated.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Of the step: parts that are not passed are halved down to this share of the tolerance, so that
/// what bounds lose on them is within it.
constexpr double kShareOfTolerance = 0.25;

/// u x v, in Bernstein form.
template <class Moment>
std::array<Vector3d, 3> normalsOf(const Moment& a, const Moment& b) {
  return {a.u.cross(a.v), 0.5 * (a.u.cross(b.v) + b.u.cross(a.v)), b.u.cross(b.v)};
}

/// normal . from, likewise.
template <class Moment>
std::array<double, 4> heightsOf(const std::array<Vector3d, 3>& n, const Moment& a,
                                const Moment& b) {
  return {n[0].dot(a.from), (n[0].dot(b.from) + 2 * n[1].dot(a.from)) / 3,
          (2 * n[1].dot(b.from) + n[2].dot(a.from)) / 3, n[2].dot(b.from)};
}

/// Whether all are beyond a bound; with `either`, or all beyond it on the other side.
template <std::size_t size>
bool areBeyond(const std::array<double, size>& heights, double bound, bool either) {
  const auto [least, most] = std::minmax_element(heights.begin(), heights.end());
  return *least > bound || (either && *most < -bound);
}

}  // namespace

ShapeStep::Moment ShapeStep::at(const Shape& shape, const Vector3d& point) {
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

bool ShapeStep::staysAbove(const Moment& a, const Moment& b, const Scaled& is) const {
  const std::array<Vector3d, 3> n = normalsOf(a, b);
  const double length =
      std::sqrt(std::max({n[0].squaredNorm(), n[1].squaredNorm(), n[2].squaredNorm()}));
  return areBeyond(heightsOf(n, a, b), is.distance * length + is.error, m_before.isTwoSided());
}

bool ShapeStep::staysOutside(const Moment& a, const Moment& b, const Scaled& is) const {
  const auto& [exponent, distance, error, radius] = is;
  const double reach = radius + distance;
  const std::array<double, 3> squares{a.u.squaredNorm(), a.u.dot(b.u), b.u.squaredNorm()};
  const double longest = std::max(squares[0], squares[2]),
               furthest = std::sqrt(std::max(a.from.squaredNorm(), b.from.squaredNorm()));
  // All of it is in a ball about its centre.
  const double half = 0.5 * (b.from - a.from).norm();
  if ((0.5 * (a.from + b.from)).norm() - half >
      distance + std::hypot(radius, 0.5 * std::sqrt(longest)) + error)
    return true;
  // Beyond an end: from . u less half the square of u.
  const std::array<double, 3> along{a.from.dot(a.u), 0.5 * (a.from.dot(b.u) + b.from.dot(a.u)),
                                    b.from.dot(b.u)};
  const double needed = std::sqrt(longest) * (distance + error);
  for (const double side : {1.0, -1.0}) {
    std::array<double, 3> beyond;
    for (int i = 0; i < 3; ++i) beyond[i] = side * along[i] - 0.5 * squares[i];
    if (areBeyond(beyond, needed, false)) return true;
  }
  // Beyond the mantle: the square of from x u less that of the reach times u.
  const Vector3d k0 = a.from.cross(a.u), k1 = 0.5 * (a.from.cross(b.u) + b.from.cross(a.u)),
                 k2 = b.from.cross(b.u);
  const auto& [q0, q1, q2] = squares;
  const double square = reach * reach;
  const std::array<double, 5> across{
      k0.dot(k0) - square * q0, k0.dot(k1) - square * (q0 + q1) / 2,
      (k0.dot(k2) + 2 * k1.dot(k1)) / 3 - square * (q0 + 4 * q1 + q2) / 6,
      k1.dot(k2) - square * (q1 + q2) / 2, k2.dot(k2) - square * q2};
  return areBeyond(across, error * (furthest + reach) * longest, false) || staysFar(a, b, is);
}

/// At half time the point is further from the cylinder than either moves until then: from there a
/// cylinder comes to any other by turning about its centre, and growing along its axis.
bool ShapeStep::staysFar(const Moment& a, const Moment& b, const Scaled& is) const {
  const Moment middle = between(a, b, 0.5);
  const Vector3d along = middle.u.normalized();
  const double chord =
      std::max((a.u.normalized() - along).norm(), (b.u.normalized() - along).norm());
  if (!(chord < 1)) return false;  // or one has no direction: only by the ball
  const double moves = 0.5 * (b.from - a.from).norm() + 0.25 * (b.u - a.u).norm() +
                       chord * std::hypot(is.radius, 0.5 * middle.u.norm());
  const double middleDistance =
      std::ldexp(distanceAt(scaledBy(-is.exponent, middle)).distance, is.exponent);
  return middleDistance - moves > is.distance + is.error;
}

SignedDistance ShapeStep::distanceAt(const Moment& moment) const {
  if (m_before.isPlane()) {
    const Vector3d normal = moment.u.cross(moment.v).stableNormalized();
    return {normal.dot(moment.from), normal};
  }
  return m_before.ofCylinder(moment.from, moment.u);
}

std::optional<double> ShapeStep::timeNear(const Point& point, double distance,
                                          double tolerance) const {
  const double size =
      m_before.magnitude() + m_now.magnitude() + largest(point[0]) + largest(point[1]) + distance;
  const int exponent = isModerate(size) ? 0 : exponentTowardsOne(size);
  const auto near = [&](double length) { return std::ldexp(length, exponent); };
  const Scaled is{exponent, near(distance), kShapeBoundError * near(size), near(m_before.radius())};
  const Moment start = scaledBy(exponent, before(point[0])),
               end = scaledBy(exponent, now(point[1]));
  const auto passes = [&](double from, double to) {
    const Moment a = between(start, end, from), b = between(start, end, to);
    return m_before.isPlane() ? staysAbove(a, b, is) : staysOutside(a, b, is);
  };
  double time = 0, part = 1;  // time is a multiple of part, and both are exact
  while (time < 1) {
    if (passes(time, time + part)) {
      time += part;
      while (part < 1 && std::fmod(time, 2 * part) == 0) part *= 2;
    } else if (part > kShareOfTolerance * tolerance) {
      part *= 0.5;
    } else {
      return time;
    }
  }
  return {};
}

SignedDistance ShapeStep::at(const Point& point, double time) const {
  const Moment start = before(point[0]), then = between(start, now(point[1]), time);
  SignedDistance nearest = distanceAt(then);
  if (m_before.isPlane() && nearest.normal == Vector3d::Zero())
    nearest.normal = m_before.axes().col(2);
  if (m_before.isTwoSided() && distanceAt(start).distance < 0)
    nearest = {-nearest.distance, -nearest.normal};
  return nearest;
}

bool ShapeStep::mayComeNear(const Eigen::AlignedBox3d& box, double distance) const {
  const Vector3d centre = box.center();
  const Moment start = before(centre), end = now(centre);
  const std::array<Vector3d, 3> n = normalsOf(start, end);
  double extent = 0;
  for (const Vector3d& normal : n)
    extent = std::max(extent, 0.5 * normal.cwiseAbs().dot(box.sizes()));
  const double error = kShapeBoundError * (m_before.magnitude() + m_now.magnitude() +
                                           largest(box.min()) + largest(box.max()) + distance);
  return !areBeyond(heightsOf(n, start, end), distance + extent + error, m_before.isTwoSided());
}

}  // namespace palpate
