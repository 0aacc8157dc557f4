#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <variant>
#include <vector>

namespace palpate {

// Shapes in a frame that OctreeBasedCD::setTransform() places. Measures are in L, at most
// kLargestMeasure; 0 is valid. All are solid and convex, except a two-sided plane, which has no
// inside. Other values throw InvalidShape.

inline constexpr double kLargestMeasure = 1e300;                     ///< L
inline constexpr std::size_t kMaxHullPoints = std::size_t{1} << 17;  ///< of one ConvexHull

struct Sphere {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0.0;  ///< finite, not negative
  friend bool operator==(const Sphere&, const Sphere&) = default;
};

/// All points whose distance from the segment p0 p1 is at most the radius.
struct Capsule {
  Eigen::Vector3d p0 = Eigen::Vector3d::Zero(), p1 = Eigen::Vector3d::Zero();
  double radius = 0.0;  ///< finite, not negative
  friend bool operator==(const Capsule&, const Capsule&) = default;
};

/// The half-space behind the plane, or if two-sided the plane alone, which has no inside.
struct Plane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< out of the half-space; any length but 0
  bool twoSided = false;
  friend bool operator==(const Plane&, const Plane&) = default;
};

/// Its edges are parallel to the axes of the body frame.
struct Box {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d halfExtents = Eigen::Vector3d::Zero();  ///< finite, not negative
  friend bool operator==(const Box&, const Box&) = default;
};

/// Flat ends, whose centres p0 and p1 differ.
struct Cylinder {
  Eigen::Vector3d p0 = Eigen::Vector3d::Zero(), p1 = Eigen::Vector3d::UnitZ();
  double radius = 0.0;  ///< finite, not negative
  friend bool operator==(const Cylinder&, const Cylinder&) = default;
};

/// Points may be in any order, doubled, inside the hull, or exactly in one plane or on a line.
/// Errors   addAnalyticalGeometry() throws InvalidShape for no points or more than kMaxHullPoints.
/// Cost     to add n points: n log n on average. A distance tests each triangle of the hull.
struct ConvexHull {
  std::vector<Eigen::Vector3d> points;  ///< finite
  friend bool operator==(const ConvexHull&, const ConvexHull&) = default;
};

using AnalyticalGeometry = std::variant<Sphere, Capsule, Plane, Box, Cylinder, ConvexHull>;

}  // namespace palpate
