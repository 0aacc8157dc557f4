#pragma once

#include "Shapes/Shape.h"
#include "Shapes/ShapeStep.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <optional>

namespace palpate {

/// Two moving bodies, and when they first come near each other.
class ShapeApproach {
 public:
  ShapeApproach(const MovingBody& a, const MovingBody& b);

  /// The first time at which the bodies are at most `distance` apart; none if they never are.
  ///
  /// Never late. Early by at most the tolerance, or at a time at which the bodies are at most
  /// `distance`, and kShapeBoundError of their size, and what they move relative to each other in
  /// that part of the step apart. With a cylinder that turns, this motion is that of all its
  /// points.
  ///
  /// Source   a part of the step is passed if one direction separates the bodies at both its ends:
  ///          the distance along a fixed direction is the least of linear functions of time, so
  ///          that in between it is not less than at both ends. A cylinder's mantle reaches
  ///          furthest along the direction at an end of the part, or where it is across its axis.
  ///          Parts that are not passed are halved. The direction is that in which the bodies are
  ///          nearest at the middle of the part: Gilbert, Johnson, Keerthi (1988), with the
  ///          library's distance of a point from a triangle. It is verified, not trusted.
  std::optional<double> timeNear(double distance, double tolerance);
  /// At a time at which they are apart; negative distances are of what the radii overlap.
  ShapePairDistance nearestAt(double time);

  std::size_t exactDecisions() const { return m_exactDecisions; }

 private:
  struct Simplex;
  /// Of the bodies without their radii.
  struct Nearest {
    Eigen::Vector3d ofA, ofB;  ///< L, from the reference
    Eigen::Vector3d normal;    ///< unit, from b towards a
    double distance;           ///< L; 0: they touch or overlap
  };
  Eigen::Vector3d corner(const MovingBody&, std::size_t i, double time) const;
  double highest(const MovingBody&, const Eigen::Vector3d& direction, double time) const;
  Eigen::Vector3d furthest(const MovingBody&, const Eigen::Vector3d& direction, double time) const;
  double mantleReach(const MovingBody&, const Eigen::Vector3d& direction, double from,
                     double to) const;
  bool separates(const Eigen::Vector3d& direction, double from, double to, double distance) const;
  bool passes(double from, double to, double distance);
  template <class IsEnough>
  Nearest nearest(double time, IsEnough&& isEnough);

  const MovingBody m_a, m_b;
  std::array<Eigen::Vector3d, 2> m_reference;  ///< L: positions are seen from here
  double m_size;                               ///< L: of all positions, so seen, and radii
  Eigen::Vector3d m_direction;                 ///< that separated them last
  std::size_t m_exactDecisions = 0;
};

}  // namespace palpate
