#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <variant>
#include <vector>

namespace palpate {

// Analytical shapes, in a body frame that OctreeBasedCD::setTransform() places in the world. All
// measures are in L. All shapes are solid and convex, except a two-sided plane, which has no
// inside. A measure of 0 is valid: a sphere without radius is a point, a capsule without length a
// sphere, a box without height a plate. Each coordinate and each size is at most kLargestMeasure in
// magnitude. All calls take lengths in this range (Docs/Settings.md), down to the smallest double.
// addAnalyticalGeometry() throws InvalidShape for all other values.

inline constexpr double kLargestMeasure = 1e300;                     ///< L
inline constexpr std::size_t kMaxHullPoints = std::size_t{1} << 17;  ///< of one ConvexHull

/// A ball.
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

/// The half-space behind the plane. If two-sided, the plane alone, which has no inside.
struct Plane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< out of the half-space; any length but 0
  bool twoSided = false;
  friend bool operator==(const Plane&, const Plane&) = default;
};

/// A box whose edges are parallel to the axes of the body frame.
struct Box {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d halfExtents = Eigen::Vector3d::Zero();  ///< finite, not negative
  friend bool operator==(const Box&, const Box&) = default;
};

/// A cylinder with flat ends. Their centres p0 and p1 must differ.
struct Cylinder {
  Eigen::Vector3d p0 = Eigen::Vector3d::Zero(), p1 = Eigen::Vector3d::UnitZ();
  double radius = 0.0;  ///< finite, not negative
  friend bool operator==(const Cylinder&, const Cylinder&) = default;
};

/// The convex hull of at least one point, such as the tip of a tool. Points may be doubled or
/// inside. If all points are exactly in one plane, on one line or at one place, the hull is a
/// plate, a segment or a point. Points near a plane span a thin body.
/// Errors   addAnalyticalGeometry() throws InvalidShape for no points, and for more than
///          kMaxHullPoints.
/// Cost     to add: n log n for n points, on average, in any order. A distance tests each triangle
///          of the hull, and some of them several times. Points inside the hull cost nothing after
///          it was added.
struct ConvexHull {
  std::vector<Eigen::Vector3d> points;  ///< finite
  friend bool operator==(const ConvexHull&, const ConvexHull&) = default;
};

using AnalyticalGeometry = std::variant<Sphere, Capsule, Plane, Box, Cylinder, ConvexHull>;

}  // namespace palpate
