#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>

namespace palpate {

/// A contact on which a frame's CollisionData and brute force differ: a fault of this library. Of
/// Method::Auto, which may mix the answers of several methods, only what is missing is told.
struct AuditFailure {
  enum class Fault {
    Missing,   ///< expected, not found; List::Earliest: there is one before earliestTimeOfImpact()
    Invented,  ///< found, not expected, or found twice
    Different  ///< found with other values than expected
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

  GeometryId a, b;          ///< the pair, as it was added
  std::uint64_t frame = 0;  ///< counts detectCollision() from 1
  Fault fault = Fault::Missing;
  List list = List::VertexTriangle;  ///< of the CollisionData
  Contact expected{}, found{};       ///< with ids and values; monostate where there is none
  std::filesystem::path
      file{};               ///< replays the pair's frame; empty if none was asked for or written
  std::string fileError{};  ///< why it was not written, with its name
};

}  // namespace palpate
