#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <variant>
#include <vector>

namespace palpate {

// Shapes by their measures, all in L, in a body frame that OctreeBasedCD::setTransform() places in
// the world. All are solid and convex. Measures may be zero: the shape is then what is left of it,
// a sphere without radius a point, a capsule without length a sphere, a box without height a plate.
// Each coordinate and each size is at most kLargestMeasure in magnitude, and may be as small as
// double goes; others are refused (ErrorCode::InvalidShape).

inline constexpr double kLargestMeasure = 1e300;                      ///< L
inline constexpr std::size_t kMostHullPoints = std::size_t{1} << 17;  ///< of one ConvexHull

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

/// The convex hull of points: a tool's tip. At least one point; any may be doubled or inside. Of
/// points in one plane a plate, on one line a segment, at one place a point: exactly so, points
/// near a plane span a thin body.
/// Errors   more than kMostHullPoints points are refused.
/// Cost     when added, n log n for n points, expected, whatever their order: 1,000, 8,000 and
///          64,000 points of a sphere take 3, 27 and 340 ms of one core of an Intel Xeon. A
///          distance asks each triangle of the hull, some of them several times: 0.06, 0.5 and 4 ms
///          for a point beside these hulls. Points inside cost nothing after that.
struct ConvexHull {
  std::vector<Eigen::Vector3d> points;  ///< finite
};

using AnalyticalGeometry = std::variant<Sphere, Capsule, Plane, Box, Cylinder, ConvexHull>;

}  // namespace palpate
