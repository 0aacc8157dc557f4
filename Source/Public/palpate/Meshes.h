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
/// Order    each list is sorted. Each edge has its lower vertex first.
struct MeshDefects {
  std::vector<Segment> open;     ///< edges of only one triangle, as at the rim of a hole
  std::vector<Segment> flipped;  ///< edges that both triangles traverse in the same direction
  std::vector<Segment> shared;   ///< edges of three triangles or more
  /// Whether there are two triangles or more, and no two share a vertex, as in an STL file. weld()
  /// joins them.
  bool unwelded = false;
  /// Whether the mesh is closed, and its triangles are wound inward: its volume is negative by more
  /// than rounding. findMeshDefects() of positions only.
  bool insideOut = false;
  /// Pairs of triangles of different parts that intersect or touch. A part is a set of triangles
  /// connected by vertices. findMeshDefects() of positions only, and empty if unwelded.
  std::vector<ElementPair> overlapping;

  /// Whether no edge is at fault.
  bool closed() const { return open.empty() && flipped.empty() && shared.empty(); }
};

/// Finds the defects of a triangle mesh. Edges are compared by vertex indices: two vertices at one
/// place are two vertices. A triangle that names a vertex twice has no edges.
/// Errors   none.
PALPATE_EXPORT MeshDefects findMeshDefects(std::span<const Triangle> triangles);
/// Also finds the defects that positions show.
/// Cost     grows with the pairs of triangles whose boxes overlap: quadratic around one vertex of all
///          triangles, where 20,000 take 1 s.
/// Errors   as OctreeBasedCD::addTriangleMesh(); messages name the mesh geometry 0.
PALPATE_EXPORT MeshDefects findMeshDefects(const TriangleMeshView& mesh);

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
PALPATE_EXPORT const char* toString(InsideRule) noexcept;  ///< its name, or "unknown"

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
  std::array<std::uint32_t, 3> vertices;  ///< of that triangle
  Eigen::Vector3d weights;                ///< of these vertices at the surface point
  /// Unit: the penetration direction, from the vertex to the surface point.
  Eigen::Vector3d direction;
  double depth;  ///< L, positive: the distance to the surface point.
  /// False only with InsideRule::WindingNumber: the number is so near to 1/2 that the margin, or
  /// rounding, leaves open whether the vertex is inside.
  bool decided = true;
  friend bool operator==(const InsideVertex&, const InsideVertex&) = default;
};

/// The triangles with which a tetrahedral mesh collides: the faces of exactly one tetrahedron.
/// tetrahedra[i] is the tetrahedron to which triangles[i] belongs. Contacts name these triangles.
/// Order    by tetrahedron, ascending; faces of one tetrahedron in the order of the corners that
///          they do not have.
/// Winding  outward at rest, decided exactly; the order in which you pass the corners does not
///          matter. A tetrahedron without volume is wound as its neighbours are: the library goes
///          from tetrahedra with volume to their neighbours, over the fewest faces. If no such
///          tetrahedron is connected to it, the lowest tetrahedron counts as wound correctly.
///          Deformation does not change the winding, also if it inverts a tetrahedron.
struct TetrahedralSurface {
  std::span<const Triangle> triangles;
  std::span<const std::uint32_t> tetrahedra;
};

/// A point in a tetrahedral mesh. Its position is the weighted sum of its vertices' positions.
///
/// Weights  at least 0; their sum is 1 within 2^-50. A weight is exactly 0 if the point is on the
///          face without that vertex. Each is within 2^-49 of its exact value.
struct TetrahedronPoint {
  std::uint32_t tetrahedron;      ///< its index in the mesh
  Tetrahedron vertices;           ///< of the tetrahedron
  std::array<double, 4> weights;  ///< of these vertices
  friend bool operator==(const TetrahedronPoint&, const TetrahedronPoint&) = default;
};

/// A vertex of another geometry, and its place in a tetrahedral mesh.
struct EmbeddedVertex {
  std::uint32_t vertex;
  TetrahedronPoint at;
  friend bool operator==(const EmbeddedVertex&, const EmbeddedVertex&) = default;
};

}  // namespace palpate
