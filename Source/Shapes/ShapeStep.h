#pragma once

#include "Shapes/Shape.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <optional>
#include <span>

namespace palpate {

/// A convex body that moves in a step. It is the hull of corners that move linearly, or a right
/// cylinder whose end centres move linearly. All points at most a radius from it belong to it, too.
struct MovingBody {
  std::array<std::span<const Eigen::Vector3d>, 2> corners;  ///< L: before and now; or the ends
  double radius = 0.0;                                      ///< L: of a ball about each point
  double cylinderRadius = 0.0;  ///< L: a cylinder's radius about its axis
};
/// Any shape except a plane.
MovingBody movingBody(const Shape& before, const Shape& now);

/// Share of the time tolerance down to which parts of the step that are not excluded are halved.
/// What the bounds lose on the smallest parts is then within the tolerance.
inline constexpr double kShareOfTolerance = 0.25;

/// Excludes the step part by part, and halves parts that are not excluded. Returns the start of the
/// first part that is not excluded at the smallest length; none if the whole step is excluded.
/// isExcluded(from, to): whether nothing happens in that part.
template <class IsExcluded>
std::optional<double> firstTimeNotExcluded(double tolerance, IsExcluded&& isExcluded) {
  PALPATE_ASSERT(tolerance > 0.0);
  double time = 0, part = 1;  // time is a multiple of part, and both are exact
  while (time < 1) {
    if (isExcluded(time, time + part)) {
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

/// A plane or a cylinder that moves in a step, and when points come near it.
///
/// Every point of a plane moves linearly, as a box's points do. The plane's normal is therefore the
/// cross product of two directions that change linearly. A cylinder's end centres move linearly,
/// and its radius stays. At each time it is the right cylinder between them.
class ShapeStep {
 public:
  ShapeStep(const Shape& before, const Shape& now) : m_before(before), m_now(now) {
    PALPATE_ASSERT(before.isPlane() == now.isPlane());
  }

  using Point = std::array<Eigen::Vector3d, 2>;  ///< L: before and now; it moves linearly

  /// The first time at which the point is at most `distance` from the shape; for a two-sided plane,
  /// from either side. The point must be further away before the step. Never late. It is early by
  /// at most the tolerance, or the point is then within `distance` + e. e is the motion of the
  /// point, and of the shape's points beside it, in a part of the step as long as the tolerance.
  ///
  /// Source   parts of the step are excluded where bounds on polynomials keep the point outside, and
  ///          halved where they do not. The polynomials, in Bernstein form, are the point's height
  ///          over a plane, and over a cylinder's ends and axis. Beside a cylinder's rim, the bound
  ///          is how far the point and the cylinder can move.
  std::optional<double> firstTimeWithin(const Point&, double distance, double tolerance) const;
  /// Signed distance of the point at that time; for a two-sided plane, on the side from which the
  /// point came.
  PointShapeDistance signedDistanceAt(const Point&, double time) const;
  /// For a plane: the same with a body in place of the point. A two-sided plane counts from the
  /// side on which the body was before the step.
  std::optional<double> firstTimeWithin(const MovingBody&, double distance, double tolerance) const;
  /// For a plane: the distance from the body at that time. If several points of the body are
  /// equally near, the result is their middle.
  ShapePairDistance nearestAt(const MovingBody&, double time) const;
  /// For a plane: whether a point that stays in the box may come within the distance.
  bool mayComeNear(const Eigen::AlignedBox3d&, double distance) const;

 private:
  /// The point and the shape at one time. from: the point relative to a plane's point or a
  /// cylinder's centre. u, v: two directions in the plane; or u, the vector from one end of a
  /// cylinder to the other.
  struct Moment {
    Eigen::Vector3d from, u, v;
  };
  /// Lengths times a power of two, so that their fourth powers stay in the range of double.
  struct ScaledLengths {
    int exponent;
    double distance, error, radius;
  };
  Moment before(const Eigen::Vector3d& point) const { return at(m_before, point); }
  Moment now(const Eigen::Vector3d& point) const { return at(m_now, point); }
  Moment scaledBy(int exponent, const Moment&) const;
  static Moment at(const Shape&, const Eigen::Vector3d& point);
  static Moment between(const Moment&, const Moment&, double time);
  PointShapeDistance distanceAt(const Moment&) const;
  double sideOf(const MovingBody&) const;
  bool staysAbove(const Moment&, const Moment&, const ScaledLengths&) const;
  bool staysOutside(const Moment&, const Moment&, const ScaledLengths&) const;
  bool staysFar(const Moment&, const Moment&, const ScaledLengths&) const;

  const Shape &m_before, &m_now;
};

}  // namespace palpate
