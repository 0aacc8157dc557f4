#pragma once

#include <palpate/Export.h>
#include <palpate/CollisionData.h>
#include <palpate/Types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>

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

}  // namespace palpate
