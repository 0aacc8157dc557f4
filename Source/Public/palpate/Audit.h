#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Types.h>

#include <cstdint>
#include <variant>

namespace palpate {

/// A contact that the pair's method includes and that the frame's CollisionData lacks: a fault of
/// this library. Its problem can be kept in a file: see <palpate/Capture.h>.
struct AuditFailure {
  enum class List { VertexTriangle, TriangleVertex, EdgeEdge, IntersectingTriangles, Earliest };

  GeometryId a, b;      ///< the pair, as it was added
  std::uint64_t frame;  ///< counts detectCollision() from 1
  /// where the contact is missing; Earliest: earliestTimeOfImpact() is later than it
  List list;
  /// what should be there, with its feature ids
  std::variant<VertexTriangleContact, EdgeEdgeContact, TrianglePair> expected;
};

}  // namespace palpate
