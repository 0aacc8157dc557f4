#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// The edges because of which a mesh is not closed and consistently oriented. A closed mesh without
/// such edges has an inside.
///
/// Order    each list is sorted. Each edge has its lower vertex first.
struct MeshDefects {
  std::vector<Segment> open;     ///< edges of only one triangle, as at the rim of a hole
  std::vector<Segment> flipped;  ///< edges that both triangles traverse in the same direction
  std::vector<Segment> shared;   ///< edges of three triangles or more

  /// Whether the mesh has no defects.
  bool closed() const { return open.empty() && flipped.empty() && shared.empty(); }
};

/// Finds the defects of a triangle mesh. Edges are compared by vertex indices: two vertices at one
/// place are two vertices. A triangle that names a vertex twice has no edges.
/// Errors   none.
PALPATE_EXPORT MeshDefects findMeshDefects(std::span<const Triangle> triangles);

/// Which points are inside a body.
enum class InsideRule {
  /// Points about which the body's winding number, decided exactly, is not 0. The body must be
  /// closed and consistently oriented; a tetrahedral mesh always has an inside.
  Closed,
  /// Points about which the magnitude of the body's generalised winding number is at least 1/2. The
  /// body may be any set of triangles: with holes, flipped or doubled triangles, or triangles that
  /// enclose something only approximately. The inside ends near a hole in a surface that spans it.
  /// For a closed body the rule finds the same vertices as Closed.
  WindingNumber
};

/// Values out of range throw InvalidSettings.
struct InsideSettings {
  InsideRule rule = InsideRule::Closed;
  /// In [0, 1/2). WindingNumber only: a vertex whose number differs in magnitude from 1/2 by at
  /// most this is found, with InsideVertex::decided false.
  double margin = 0.0;
};

/// A vertex inside a body, with its surface point: the point of the body's surface that is nearest
/// to the vertex.
struct InsideVertex {
  std::uint32_t vertex, triangle;  ///< a vertex of the other geometry, a triangle of the body.
  std::array<std::uint32_t, 3> corners;  ///< the vertices of that triangle.
  Eigen::Vector3d barycentric;           ///< weights of the corners at the surface point.
  /// Unit: the penetration direction, from the vertex to the surface point.
  Eigen::Vector3d direction;
  double depth;  ///< L, positive: the distance to the surface point.
  /// False only with InsideRule::WindingNumber: the number is so near to 1/2 that the margin, or
  /// rounding, leaves open whether the vertex is inside.
  bool decided = true;
  friend bool operator==(const InsideVertex&, const InsideVertex&) = default;
};

}  // namespace palpate
