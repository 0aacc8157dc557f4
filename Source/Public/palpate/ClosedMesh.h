#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// What keeps a mesh from being closed and consistently oriented. Edges lower vertex first, sorted.
struct MeshDefects {
  std::vector<Segment> open;     ///< edges of one triangle only: the rim of a hole
  std::vector<Segment> flipped;  ///< edges that two triangles run through in the same direction
  std::vector<Segment> shared;   ///< edges of three triangles or more

  bool closed() const { return open.empty() && flipped.empty() && shared.empty(); }
};

/// Edges by their vertices' indices: vertices at one place are not one vertex. A triangle that
/// names a vertex twice has no edges.
PALPATE_EXPORT MeshDefects findMeshDefects(std::span<const Triangle> triangles);

/// A vertex inside a closed body, and the shortest way out.
struct InsideVertex {
  std::uint32_t vertex, triangle;        ///< of the other geometry; of the body
  std::array<std::uint32_t, 3> corners;  ///< the triangle's vertices
  Eigen::Vector3d barycentric;           ///< of the body's surface point nearest to the vertex
  Eigen::Vector3d exitDirection;         ///< unit, from the vertex towards that point
  double depth;                          ///< L, positive: the distance to it
  friend bool operator==(const InsideVertex&, const InsideVertex&) = default;
};

}  // namespace palpate
