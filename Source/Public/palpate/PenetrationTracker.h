#pragma once

#include <palpate/Export.h>
#include <palpate/Meshes.h>
#include <palpate/SpatialQueries.h>
#include <palpate/Types.h>

#include <memory>
#include <span>

namespace palpate {

/// How PenetrationTracker chose the penetration direction of a vertex. The *nearest direction*
/// leads to the nearest surface point, the *last direction* is that of the last step, turned with
/// the body.
enum class DirectionChange {
  /// The nearest direction. The vertex was not inside in the last step, or topology was set since.
  Entered,
  None,  ///< the nearest direction; it turned no further than motion explains
  /// The last direction. The nearest direction would have turned further than motion explains.
  Kept,
  /// The nearest direction, which turned further than motion explains. The last direction no longer
  /// leaves the body within the allowed depth.
  Jumped
};
PALPATE_EXPORT const char* toString(DirectionChange) noexcept;  ///< its name, or "unknown"

/// A vertex inside a body with a penetration direction that is stable over time. From step to step
/// the direction turns no further than motion explains, unless `change` is Jumped or Entered.
struct TrackedVertex {
  /// Largest turn beyond what motion explains, as the length of the difference of the two unit
  /// vectors; 0.5 is about 29 degrees.
  static constexpr double kMaxTurn = 0.5;
  /// The last direction is kept only while its depth is at most this many times the distance to the
  /// nearest surface point.
  static constexpr double kMaxDepthRatio = 2.0;

  InsideVertex penetration;  ///< Kept: where the last direction leaves the body
  InsideVertex nearest;      ///< as findInsideVertices() finds it
  DirectionChange change;
  friend bool operator==(const TrackedVertex&, const TrackedVertex&) = default;
};

/// Finds the vertices of one geometry that are inside another, a closed body, with penetration
/// directions that are stable over time. The nearest surface point jumps where two parts of the
/// surface are equally near; these directions do not. Call update() in each step, after
/// setPositions(). Docs/HowTo/Penetration.md has an example.
/// Laws     (1) the depth is at most kMaxDepthRatio times the least depth.
///          (2) a direction turns further than kMaxTurn + m only if its change is Jumped. Here m
///          is the turn that motion explains: the distance that the vertex moved from its last
///          surface point, divided by the square root of the last depth times the least depth now.
/// Method   the last direction turns with the triangle of the last surface point. If the nearest
///          direction is within kMaxTurn + m of it, the nearest is taken (None). Else the last
///          direction is kept if it leaves the body within kMaxDepthRatio times the least depth
///          (Kept). Else the nearest is taken (Jumped).
/// Threads  use an object from one thread at a time.
class PALPATE_EXPORT PenetrationTracker {
 public:
  /// The ids are those of the OctreeBasedCD whose queries update() receives; update() checks them.
  PenetrationTracker(GeometryId vertices, GeometryId body);
  PenetrationTracker(PenetrationTracker&&) noexcept;
  PenetrationTracker& operator=(PenetrationTracker&&) noexcept;
  ~PenetrationTracker();

  /// Computes the directions of this step. You may call it any number of times in a step: it
  /// continues from the last earlier step in which it received queries of the same OctreeBasedCD.
  /// The span is valid until the next call.
  /// Order    by vertex, ascending.
  /// Errors   those of SpatialQueries::findInsideVertices() with default settings; the tracker then
  ///          keeps the directions of earlier steps. InvalidCall after a move.
  std::span<const TrackedVertex> update(const SpatialQueries&);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
