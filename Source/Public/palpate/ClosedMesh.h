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

/// What is inside a body.
enum class InsideRule {
  /// Where its winding number, decided exactly, is not zero. It must be closed and consistently
  /// oriented.
  Closed,
  /// Where the magnitude of its generalised winding number is at least 1/2: of any triangles, with
  /// holes, flipped, doubled, of soups that only almost enclose something. A hole's inside ends
  /// near
  /// it in a surface that spans it; of a closed body the same vertices as Closed.
  WindingNumber
};

struct InsideSettings {
  InsideRule rule = InsideRule::Closed;
  /// [0, 1/2). WindingNumber: vertices whose number's magnitude is no further than this from 1/2
  /// are found, but not decided.
  double margin = 0.0;
};

/// A vertex inside a body, with the nearest point of its surface.
struct InsideVertex {
  std::uint32_t vertex, triangle;        ///< of the other geometry; of the body
  std::array<std::uint32_t, 3> corners;  ///< the triangle's vertices
  Eigen::Vector3d barycentric;           ///< of the body's surface point nearest to the vertex
  Eigen::Vector3d
      direction;  ///< unit: the penetration direction, from the vertex towards that point
  double depth;   ///< L, positive: the distance to it
  /// InsideRule::WindingNumber: not within the margin, nor within rounding, of 1/2.
  bool decided = true;
  friend bool operator==(const InsideVertex&, const InsideVertex&) = default;
};

}  // namespace palpate
