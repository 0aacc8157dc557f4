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

/// A contact in which a frame's CollisionData and brute force differ. This is a fault of the
/// library. Method::Auto may mix the answers of several methods; for it the audit reports only
/// missing contacts. Where a step begins in intersection it does not miss those of vertices of
/// triangles that intersect, nor any of bodies of which Auto left out contacts on an inner side.
struct AuditFailure {
  enum class Fault {
    /// Expected, not found. In List::Earliest: a contact is earlier than earliestTimeOfImpact().
    FalseNegative,
    FalsePositive,  ///< found, not expected, or found twice
    Different       ///< found with other values than expected
  };
  /// The list of CollisionData, or its earliest time.
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

// A capture is a text file with a CollisionProblem. It replays a frame exactly: every double keeps
// its bits.

/// Writes OctreeBasedCD::problem() to a file. Call it after a frame and before positions change:
/// the capture then replays that frame.
/// Errors   File if it cannot be written; an existing file is then unchanged. NonFinitePosition for
///          a body that is placed beyond kLargestMeasure: captures hold positions in the world.
PALPATE_EXPORT void capture(const OctreeBasedCD&, const std::filesystem::path&);

/// The same for the pair of an audit's failure alone. Call it before positions change, too.
PALPATE_EXPORT void capture(const OctreeBasedCD&, const AuditFailure&,
                            const std::filesystem::path&);

/// Writes a problem to a file, with the errors of capture() and setUp().
PALPATE_EXPORT void writeCapture(const CollisionProblem&, const std::filesystem::path&);

/// Reads a capture.
/// Errors   File, with the file's name and the reason: the file is missing, is no capture, has an
///          unknown version, is truncated, or has content that an OctreeBasedCD refuses.
PALPATE_EXPORT CollisionProblem readCapture(const std::filesystem::path&);

/// Makes an OctreeBasedCD from a problem, ready for detectCollision(). Geometry i has the id
/// GeometryId{i}. Its octrees are built anew; contacts do not depend on their history.
/// Errors   those of the functions of OctreeBasedCD that add geometries and pairs.
PALPATE_EXPORT OctreeBasedCD setUp(const CollisionProblem&);

}  // namespace palpate
