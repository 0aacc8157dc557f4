#pragma once

#include <palpate/AnalyticalGeometry.h>
#include <palpate/DistanceField.h>
#include <palpate/Settings.h>
#include <palpate/Types.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace palpate {

/// Everything on which the answers of one frame depend, except predicates. Get it from
/// OctreeBasedCD::problem(). <palpate/Capture.h> writes and reads it, and makes an OctreeBasedCD
/// from it.
struct CollisionProblem {
  /// A geometry of any type.
  struct Geometry {
    GeometryId id;  ///< in the original OctreeBasedCD; no answer depends on it
    /// L, in the world, also if setTransform() placed the geometry; of a mesh with a distance field
    /// or leaves in the body's frame.
    std::vector<Eigen::Vector3d> before, now;
    std::vector<Triangle> triangles;  ///< segment {p, q} is {p, q, q}; empty for points
    GeometryType type = GeometryType::Triangles;
    std::vector<double> radii{};  ///< L: none, one for all vertices, or one per vertex
    /// L: the positions that determine PairSettings::restDistance and the winding of the surface of
    /// tetrahedra. Empty: `now`.
    std::vector<Eigen::Vector3d> rest{};
    CollisionFilter filter{};
    std::vector<std::uint32_t> disabled{};           ///< disabled elements
    std::optional<AnalyticalGeometry> analytical{};  ///< a shape; `motion` places it
    RigidMotion motion{};                            ///< of setTransform()
    std::vector<Tetrahedron> tetrahedra{};  ///< `triangles` is their surface; empty: no tetrahedra
    /// The field of an added distance field, or of a mesh that has one; `motion` places it.
    std::shared_ptr<const DistanceField> field{};
    std::optional<SurfaceProxySettings> proxy{};  ///< of the leaves that are attached to a mesh
    std::string name{};                           ///< OctreeBasedCD::setName(); not in a file
  };
  /// A collision pair.
  struct Pair {
    std::uint32_t a, b;  ///< indices in `geometries`
    PairSettings settings;
    Method method;  ///< the method that answered; no answer depends on it
    /// Whether the pair has a predicate. A problem does not contain it, so that a replay may find
    /// more contacts.
    bool predicate = false;
  };
  Settings settings;  ///< without an executor
  std::vector<Geometry> geometries;
  std::vector<Pair> pairs;  ///< in the order in which they were added
};

}  // namespace palpate
