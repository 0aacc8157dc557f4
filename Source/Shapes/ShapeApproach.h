#pragma once

#include "Shapes/Shape.h"
#include "Shapes/ShapeStep.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <optional>

namespace palpate {

/// Finds when two moving bodies first come near each other.
class ShapeApproach {
 public:
  ShapeApproach(const MovingBody& a, const MovingBody& b);

  /// The first time at which the bodies are at most `distance` apart; none if they never are.
  ///
  /// Never late. It is early by at most the tolerance, or the bodies are then at most `distance` +
  /// e apart. e is kShapeBoundError of their size, plus their relative motion in a part of the step
  /// as long as the tolerance. For a cylinder that turns, the motion of all its points counts.
  ///
  /// Source   a part of the step is excluded if one direction separates the bodies at both its ends.
  ///          The distance along a fixed direction is the least of linear functions of time; in
  ///          between it is therefore not less than at both ends. A cylinder's lateral surface
  ///          reaches furthest along the direction at an end of the part, or when its axis is
  ///          perpendicular to the direction. Parts that are not excluded are halved. The direction
  ///          joins the nearest points of the bodies at the middle of the part: Gilbert, Johnson,
  ///          Keerthi (1988), with the library's distance of a point from a triangle. That it
  ///          separates the bodies is verified.
  std::optional<double> firstTimeWithin(double distance, double tolerance);
  /// The nearest points at a time at which the bodies without their radii are apart. A negative
  /// distance is the overlap of the radii.
  ShapePairDistance nearestAt(double time);

  std::size_t exactDecisions() const { return m_exactDecisions; }

 private:
  struct Simplex;
  /// Nearest points of the bodies without their radii.
  struct Nearest {
    Eigen::Vector3d ofA, ofB;  ///< L, relative to m_reference
    Eigen::Vector3d normal;    ///< unit, from b towards a
    double distance;           ///< L; 0: they touch or overlap
  };
  Eigen::Vector3d corner(const MovingBody&, std::size_t i, double time) const;
  double highest(const MovingBody&, const Eigen::Vector3d& direction, double time) const;
  Eigen::Vector3d furthest(const MovingBody&, const Eigen::Vector3d& direction, double time) const;
  double lateralExtent(const MovingBody&, const Eigen::Vector3d& direction, double from,
                       double to) const;
  bool separates(const Eigen::Vector3d& direction, double from, double to, double distance) const;
  bool isExcluded(double from, double to, double distance);
  template <class IsEnough>
  Nearest nearest(double time, IsEnough&& isEnough);

  const MovingBody m_a, m_b;
  std::array<Eigen::Vector3d, 2> m_reference;  ///< L: positions are relative to it
  double m_size;                ///< L: extent of the relative positions, plus the radii
  Eigen::Vector3d m_direction;  ///< the last one that separated the bodies
  std::size_t m_exactDecisions = 0;
};

}  // namespace palpate
