#pragma once

#include <palpate/AnalyticalGeometry.h>
#include <palpate/Settings.h>
#include <palpate/Types.h>

#include <cstdint>
#include <optional>
#include <vector>

namespace palpate {

/// All that one frame's answers depend on.
struct CollisionProblem {
  struct Mesh {
    GeometryId id;                             ///< where it comes from; nothing depends on it
    std::vector<Eigen::Vector3d> before, now;  ///< in the world, also of a body that was moved
    std::vector<Triangle> triangles;           ///< a segment {p, q} is {p, q, q}; none of points
    GeometryKind kind = GeometryKind::Triangles;
    std::vector<double> radii{};  ///< L: none, one for all, or one for each vertex
    /// The shape that restDistance, and tetrahedra's surface, are of; none: now.
    std::vector<Eigen::Vector3d> rest{};
    CollisionFilter filter{};
    std::vector<std::uint32_t> disabled{};           ///< elements that are off
    std::optional<AnalyticalGeometry> analytical{};  ///< of a shape, placed by what follows
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();
    Eigen::Matrix3d rotationBefore = Eigen::Matrix3d::Identity();  ///< of a shape
    Eigen::Vector3d translationBefore = Eigen::Vector3d::Zero();
    std::vector<Tetrahedron> tetrahedra{};  ///< whose surface the triangles are; none: just these
  };
  struct Pair {
    std::uint32_t a, b;  ///< indices of geometries
    PairSettings settings;
    Method method;  ///< that answered, of Validity; nothing depends on it
    /// A predicate was asked, which is not part of a problem: without it there may be more
    /// contacts.
    bool predicate = false;
  };
  Settings settings;
  std::vector<Mesh> geometries;
  std::vector<Pair> pairs;  ///< in the order added
};

}  // namespace palpate
