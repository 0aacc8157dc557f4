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

/// A vertex inside a body, and the shortest way out.
struct InsideVertex {
  std::uint32_t vertex, triangle;        ///< of the other geometry; of the body
  std::array<std::uint32_t, 3> corners;  ///< the triangle's vertices
  Eigen::Vector3d barycentric;           ///< of the body's surface point nearest to the vertex
  Eigen::Vector3d exitDirection;         ///< unit, from the vertex towards that point
  double depth;                          ///< L, positive: the distance to it
  /// InsideRule::WindingNumber: not within the margin, nor within rounding, of 1/2.
  bool decided = true;
  friend bool operator==(const InsideVertex&, const InsideVertex&) = default;
};

/// What became of a vertex's way out since the last call of followInsideVertices().
enum class ExitChange {
  Entered,  ///< the vertex was not inside then, or topology was set since: the nearest
  None,     ///< the nearest
  Kept,     ///< the nearest would have turned further than motion explains: the last direction
  Jumped    ///< the same, and the last direction is no way out any more: the nearest
};

/// A vertex inside a body, and a way out that turns no further from call to call than motion
/// explains, unless it says so.
struct FollowedVertex {
  /// Between the last direction and this, as lengths of differences of unit vectors, beyond what
  /// motion explains.
  static constexpr double kMostTurn = 0.5;
  /// A direction is kept while it leaves the body no further away than this times the nearest way.
  static constexpr double kMostDepth = 2.0;

  InsideVertex wayOut;   ///< Kept: where the direction kept leaves the body
  InsideVertex nearest;  ///< as findInsideVertices() has it
  ExitChange change;
  friend bool operator==(const FollowedVertex&, const FollowedVertex&) = default;
};

}  // namespace palpate
