#pragma once

#include <palpate/Types.h>

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// The triangles with which a tetrahedral mesh collides: the faces of exactly one tetrahedron.
/// tetrahedra[i] is the tetrahedron to which triangles[i] belongs. Contacts name these triangles.
///
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
