#pragma once

#include <palpate/ClosedMesh.h>
#include <palpate/Export.h>
#include <palpate/TetrahedralMesh.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace palpate {

/// Searches over the geometries of one OctreeBasedCD, at their positions now. Get it from
/// OctreeBasedCD::queries(). Collision filters do not apply, and disabled elements take part.
///
///   const SpatialQueries queries = collisions.queries();
///   std::vector<InsideVertex> inside;
///   queries.findInsideVertices(needle, organ, inside);
///   for (const InsideVertex& v : inside) pushOut(v.vertex, v.depth * v.direction);
///
/// Valid    until positions, transforms, topology or geometries change, or advance() is called. A
///          detection leaves it valid. Copies are cheap.
/// Threads  all functions are safe from any number of threads.
/// Results  go to the caller's vectors, which are overwritten. Where a function throws, they are
///          unchanged.
/// Errors   InvalidCall where the queries are not valid any more, or where a predicate or callback
///          asks while its OctreeBasedCD computes; UnknownGeometry.
class PALPATE_EXPORT SpatialQueries {
 public:
  /// The vertices of one geometry that are inside another, a closed body, also where it is concave
  /// and where no triangles cross. `out`: ascending vertices.
  ///
  /// Inside: the body's winding number about the vertex, decided exactly, is not zero, or, for a
  /// tetrahedral mesh, the vertex is in a tetrahedron; and the vertex does not lie on the surface.
  /// The surface point is the nearest one; of several equally near, that on the lowest triangle.
  /// Depth and surface point are as exact as vertexTriangleDistance().
  /// InsideRule::WindingNumber: for bodies with holes, and for any set of triangles.
  /// Errors   NotClosed names the first edge at fault; InvalidSettings for one geometry twice, and
  ///          for a margin outside its range; UnsupportedMethod for a shape as `vertices`.
  void findInsideVertices(GeometryId vertices, GeometryId body, std::vector<InsideVertex>& out,
                          const InsideSettings& = {}) const;
  /// The vertices of one geometry in the tetrahedra of another, or on their boundary, decided
  /// exactly. `out`: ascending vertices, each once, in the lowest of its tetrahedra. A tetrahedron
  /// that deformation inverted holds points as others do; one without volume has none.
  ///
  /// Errors   UnsupportedMethod for a body that is no tetrahedral mesh and for a shape as
  ///          `vertices`, InvalidSettings for one geometry twice.
  void findEmbeddedVertices(GeometryId vertices, GeometryId body,
                            std::vector<EmbeddedVertex>& out) const;
  /// The same for one point.
  /// Errors   NonFinitePosition, too.
  std::optional<TetrahedronPoint> findTetrahedron(GeometryId body,
                                                  const Eigen::Vector3d& point) const;

  class Source;
  explicit SpatialQueries(std::shared_ptr<Source>);

 private:
  friend class PenetrationTracker;
  Source& valid() const;  ///< throws InvalidCall

  std::shared_ptr<Source> m_source;
  std::uint64_t m_state;  ///< Source::state() when it was made
};

}  // namespace palpate
