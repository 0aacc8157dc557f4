#pragma once

#include "Geometry/Shape.h"

#include <Eigen/Geometry>

#include <array>
#include <optional>

namespace palpate {

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
  bool staysAbove(const Moment&, const Moment&, const Scaled&) const;
  bool staysOutside(const Moment&, const Moment&, const Scaled&) const;
  bool staysFar(const Moment&, const Moment&, const Scaled&) const;

  const Shape &m_before, &m_now;
};

}  // namespace palpate
