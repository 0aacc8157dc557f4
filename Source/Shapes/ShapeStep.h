#pragma once

#include "Shapes/Shape.h"

#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <optional>
#include <span>

namespace palpate {

/// A convex body that moves in a step: the hull of corners that move linearly, or a right cylinder
/// whose ends' centres do; and all that is at most a radius from it.
struct MovingBody {
  std::array<std::span<const Eigen::Vector3d>, 2> corners;  ///< L: before and now; or the ends
  double radius = 0.0;                                      ///< L: of a ball about each point
  double mantle = 0.0;                                      ///< L: of a cylinder, about its axis
};
/// Of any shape but a plane.
MovingBody movingBody(const Shape& before, const Shape& now);

/// Of the step: parts that are not passed are halved down to this share of the tolerance, so that
/// what bounds lose on them is within it.
inline constexpr double kShareOfTolerance = 0.25;

/// Where a step that is passed part by part is held up first; none if it is not.
/// passes(from, to): whether nothing happens in that part.
template <class Passes>
std::optional<double> firstNotPassed(double tolerance, Passes&& passes) {
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

/// A plane or a cylinder that moves in a step, and when points come near to it.
///
/// Of a plane every point moves linearly, as those of a box do, so that its normal is the cross
/// product of two directions that do. Of a cylinder the ends' centres do, and the radius stays: it
/// is a right cylinder between them at each time.
class ShapeStep {
 public:
  ShapeStep(const Shape& before, const Shape& now) : m_before(before), m_now(now) {}

  using Point = std::array<Eigen::Vector3d, 2>;  ///< L: before and now; it moves linearly

  /// When the point, further away before the step, first is at most `distance` from the shape; of a
  /// plane of two sides from either. Never late, and early by at most the tolerance, or where it
  /// comes within the distance and that part of its motion and of the points beside it.
  ///
  /// Source   parts of the step are passed where bounds on polynomials keep the point outside, halved
  ///          where they do not: of its height over a plane, and over a cylinder's ends and axis,
  ///          in Bernstein form; beside a cylinder's rim, of how far all can move.
  std::optional<double> timeNear(const Point&, double distance, double tolerance) const;
  /// Of it then; of a plane of two sides on the side from where it came.
  SignedDistance at(const Point&, double time) const;
  /// Of a plane, and a body in place of the point: of a plane of two sides from the side on which
  /// the body was before the step.
  std::optional<double> timeNear(const MovingBody&, double distance, double tolerance) const;
  /// From the body, then. Where several of its points are as near, the middle of them.
  ShapePairDistance at(const MovingBody&, double time) const;
  /// Of a plane: whether a point that stays in the box may come so near.
  bool mayComeNear(const Eigen::AlignedBox3d&, double distance) const;

 private:
  /// At a time: the point from a plane's point or a cylinder's centre; two directions in the plane,
  /// or from one end of the cylinder to the other.
  struct Moment {
    Eigen::Vector3d from, u, v;
  };
  /// Lengths times a power of two, so that their fourth powers stay in the range of double.
  struct Scaled {
    int exponent;
    double distance, error, radius;
  };
  Moment before(const Eigen::Vector3d& point) const { return at(m_before, point); }
  Moment now(const Eigen::Vector3d& point) const { return at(m_now, point); }
  Moment scaledBy(int exponent, const Moment&) const;
  static Moment at(const Shape&, const Eigen::Vector3d& point);
  static Moment between(const Moment&, const Moment&, double time);
  SignedDistance distanceAt(const Moment&) const;
  double sideOf(const MovingBody&) const;
  bool staysAbove(const Moment&, const Moment&, const Scaled&) const;
  bool staysOutside(const Moment&, const Moment&, const Scaled&) const;
  bool staysFar(const Moment&, const Moment&, const Scaled&) const;

  const Shape &m_before, &m_now;
};

}  // namespace palpate
