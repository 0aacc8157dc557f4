#pragma once

#include <palpate/AnalyticalGeometry.h>
#include <palpate/CollisionData.h>
#include <palpate/DistanceField.h>
#include <palpate/Export.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/Settings.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace palpate {

/// A contact in which a frame and brute force differ: a fault of the library. Of Auto only missing
/// ones are reported, with two exceptions (Docs/Accuracy.md).
struct AuditFailure {
  enum class Fault {
    FalseNegative,  ///< not found; Earliest: too late
    FalsePositive,  ///< found, not expected, or found twice
    Different       ///< found with other values than expected
  };
  enum class List {
    VertexTriangle,
    TriangleVertex,
    EdgeEdge,
    IntersectingTriangles,
    Earliest,
    Shape,
    ShapeShape
  };
  using Contact = std::variant<std::monostate, VertexTriangleContact, EdgeEdgeContact, ElementPair,
                               ShapeContact, ShapeShapeContact>;

  GeometryId a, b;          ///< the pair, in the order in which it was added
  std::uint64_t frame = 0;  ///< number of the detectCollision() call, from 1
  Fault fault = Fault::FalseNegative;
  List list = List::VertexTriangle;  ///< The list in which the contact is or should be.
  Contact expected{}, found{};       ///< The contact; monostate: it does not exist.
  std::filesystem::path file{};      ///< Capture of the pair's frame; empty: not written.
  std::string fileError{};           ///< Why the capture was not written, with its name.
};
PALPATE_EXPORT const char* toString(AuditFailure::Fault) noexcept;  ///< its name, or "unknown"
PALPATE_EXPORT const char* toString(AuditFailure::List) noexcept;   ///< its name, or "unknown"

/// All on which a frame depends except predicates, from OctreeBasedCD::problem().
struct CollisionProblem {
  struct Geometry {
    GeometryId id;  ///< in the original OctreeBasedCD; no answer depends on it
    /// L, in the world, also if placed; of a mesh with a field or leaves in the body's frame.
    std::vector<Eigen::Vector3d> before, now;
    std::vector<Triangle> triangles;  ///< segment {p, q} is {p, q, q}; empty for points
    GeometryType type = GeometryType::Triangles;
    std::vector<double> radii{};  ///< L: none, one for all vertices, or one per vertex
    /// L: the positions of restDistance and of the winding of tetrahedra's surface. Empty: `now`.
    std::vector<Eigen::Vector3d> rest{};
    CollisionFilter filter{};
    std::vector<std::uint32_t> disabled{};           ///< disabled elements
    std::optional<AnalyticalGeometry> analytical{};  ///< a shape; `motion` places it
    RigidMotion motion{};                            ///< of setTransform()
    std::vector<Tetrahedron> tetrahedra{};  ///< `triangles` is their surface; empty: no tetrahedra
    std::shared_ptr<const DistanceField> field{};  ///< placed by `motion`
    std::optional<SurfaceProxySettings> proxy{};   ///< of the leaves that are attached to a mesh
    std::string name{};                            ///< OctreeBasedCD::setName(); not in a file
    std::vector<std::uint32_t> removed{};  ///< OctreeBasedCD::removedElements(), in `triangles`
    std::vector<std::uint32_t> removedTetrahedra{};
    std::vector<std::uint32_t> tags{};  ///< OctreeBasedCD::tags()
  };
  struct Pair {
    std::uint32_t a, b;  ///< indices in `geometries`
    PairSettings settings;
    Method method;           ///< the method that answered; no answer depends on it
    bool predicate = false;  ///< of which there is no copy: a replay may find more
    /// CollisionData::rememberedSides() of the step.
    std::vector<Crossing> sides{};
  };
  Settings settings;  ///< without an executor
  std::vector<Geometry> geometries;
  std::vector<Pair> pairs;  ///< in the order in which they were added
};

// A capture is a text file of a CollisionProblem that keeps every double's bits.

/// Writes OctreeBasedCD::problem(): after a frame and before positions change it is that frame.
/// Errors   File, and an existing file is then unchanged; NonFinitePosition beyond kLargestMeasure.
PALPATE_EXPORT void capture(const OctreeBasedCD&, const std::filesystem::path&);

PALPATE_EXPORT void capture(const OctreeBasedCD&, const AuditFailure&,
                            const std::filesystem::path&);

/// Writes a problem to a file, with the errors of capture() and setUp().
PALPATE_EXPORT void writeCapture(const CollisionProblem&, const std::filesystem::path&);

/// Reads a capture. Throws File with a reason, also for content that an OctreeBasedCD refuses.
PALPATE_EXPORT CollisionProblem readCapture(const std::filesystem::path&);

/// A new OctreeBasedCD, where geometry i is GeometryId{i}. Throws as the calls that add to it.
PALPATE_EXPORT OctreeBasedCD setUp(const CollisionProblem&);

}  // namespace palpate
