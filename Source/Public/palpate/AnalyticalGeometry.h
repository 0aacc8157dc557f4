#pragma once

#include <Eigen/Core>

#include <variant>

namespace palpate {

// Shapes by their measures, all in L, in a body frame that OctreeBasedCD::setTransform() places in
// the world. All are solid and convex. Measures may be zero: the shape is then what is left of it,
// a sphere without radius a point, a capsule without length a sphere, a box without height a plate.

struct Sphere {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0.0;  ///< finite, not negative
};

/// All points at most the radius from the segment.
struct Capsule {
  Eigen::Vector3d p0 = Eigen::Vector3d::Zero(), p1 = Eigen::Vector3d::Zero();
  double radius = 0.0;  ///< finite, not negative
};

/// The half-space behind the plane; of two sides: the plane alone, which has no inside.
struct Plane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< out of the half-space; any length but 0
  bool twoSided = false;
};

/// Along the axes of the body frame.
struct Box {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d halfExtents = Eigen::Vector3d::Zero();  ///< finite, not negative
};

/// With flat ends, whose centres p0 and p1 must differ.
struct Cylinder {
  Eigen::Vector3d p0 = Eigen::Vector3d::Zero(), p1 = Eigen::Vector3d::UnitZ();
  double radius = 0.0;  ///< finite, not negative
};

using AnalyticalGeometry = std::variant<Sphere, Capsule, Plane, Box, Cylinder>;

}  // namespace palpate
