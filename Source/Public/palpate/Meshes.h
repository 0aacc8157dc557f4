#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// The edges, sorted, lower vertex first, at which a mesh is not closed and consistently oriented.
struct MeshDefects {
  std::vector<Segment> open;     ///< edges of only one triangle, as at the rim of a hole
  std::vector<Segment> flipped;  ///< edges that both triangles traverse in the same direction
  std::vector<Segment> shared;   ///< edges of three triangles or more
  bool unwelded = false;   ///< no two triangles share a vertex, as in STL files: weld() joins them
  bool insideOut = false;  ///< from positions: the volume is negative, by more than rounding
  /// From positions, unless unwelded: triangles that meet, of parts not connected by vertices.
  std::vector<ElementPair> overlapping;

  bool closed() const { return open.empty() && flipped.empty() && shared.empty(); }
};

/// Compares edges by vertex indices. A triangle that names a vertex twice has no edges.
PALPATE_EXPORT MeshDefects findMeshDefects(std::span<const Triangle> triangles);
/// Also finds what positions show. Throws as OctreeBasedCD::addTriangleMesh(), for geometry 0.
/// Cost     grows with the overlapping boxes of triangles: 1 s for 20,000 around one vertex.
PALPATE_EXPORT MeshDefects findMeshDefects(const TriangleMeshView& mesh);

enum class InsideRule {
  /// Where the winding number of a closed mesh is not 0, or in a tetrahedron, decided exactly.
  Closed,
  /// Where the generalised winding number is at least 1/2 in magnitude. Closed bodies: as Closed.
  WindingNumber
};
PALPATE_EXPORT const char* toString(InsideRule) noexcept;  ///< its name, or "unknown"

/// Values out of range throw InvalidSettings.
struct InsideSettings {
  InsideRule rule = InsideRule::Closed;
  /// In [0, 1/2). WindingNumber finds vertices this near to 1/2 with InsideVertex::decided false.
  double margin = 0.0;
};

/// A vertex in a body, and the nearest point of the body's surface.
struct InsideVertex {
  std::uint32_t vertex, triangle;  ///< a vertex of the other geometry, a triangle of the body.
  std::array<std::uint32_t, 3> vertices;  ///< of that triangle
  Eigen::Vector3d weights;                ///< of these vertices at the surface point
  Eigen::Vector3d direction;              ///< unit, from the vertex to the surface point
  double depth;                           ///< L, positive: the distance to the surface point.
  /// False only with WindingNumber, if the margin or rounding leaves open whether it is inside.
  bool decided = true;
  friend bool operator==(const InsideVertex&, const InsideVertex&) = default;
};

/// The triangles with which a tetrahedral mesh collides: faces of exactly one tetrahedron.
/// triangles[i] belongs to tetrahedra[i], which is kNoElement for OctreeBasedCD::removedElements().
/// Order    by tetrahedron, then by the corner that the face lacks; after cuts by age.
/// Winding  outward at rest, decided exactly; deformation does not change it. Tetrahedra without
///          volume are wound as the nearest ones with volume over faces, or as the lowest.
struct TetrahedralSurface {
  std::span<const Triangle> triangles;
  std::span<const std::uint32_t> tetrahedra;
};

/// A point of a tetrahedral mesh, as the weighted sum of vertices. Weights are at least 0, within
/// 2^-49 of exact, sum to 1 within 2^-50, and are 0 for vertices off a face that holds it.
struct TetrahedronPoint {
  std::uint32_t tetrahedron;      ///< its index in the mesh
  Tetrahedron vertices;           ///< of the tetrahedron
  std::array<double, 4> weights;  ///< of these vertices
  friend bool operator==(const TetrahedronPoint&, const TetrahedronPoint&) = default;
};

struct EmbeddedVertex {
  std::uint32_t vertex;
  TetrahedronPoint at;
  friend bool operator==(const EmbeddedVertex&, const EmbeddedVertex&) = default;
};

}  // namespace palpate
