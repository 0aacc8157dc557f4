#pragma once

#include <palpate/ClosedMesh.h>
#include <palpate/Export.h>
#include <palpate/SpatialQueries.h>
#include <palpate/Types.h>

#include <memory>
#include <span>

namespace palpate {

/// How a vertex's penetration direction differs from that of the step before.
enum class DirectionChange {
  Entered,  ///< the vertex was not inside then, or topology was set since: the nearest
  None,     ///< the nearest
  Kept,     ///< the nearest would have turned further than motion explains: the last direction
  Jumped    ///< the same, but the last direction does not leave the body any more: the nearest
};

/// A vertex inside a body, with a penetration direction that turns no further from step to step
/// than motion explains, unless `change` says so.
struct TrackedVertex {
  /// Between the last direction and this, as lengths of differences of unit vectors, beyond what
  /// motion explains.
  static constexpr double kMostTurn = 0.5;
  /// A direction is kept while it leaves the body at most this many times as far away as the
  /// nearest surface point is.
  static constexpr double kMostDepth = 2.0;

  InsideVertex penetration;  ///< Kept: where the direction kept leaves the body
  InsideVertex nearest;      ///< as findInsideVertices() has it
  DirectionChange change;
  friend bool operator==(const TrackedVertex&, const TrackedVertex&) = default;
};

/// The vertices of one geometry inside another, a closed body, with penetration directions that do
/// not flip from step to step. Call update() in each step, after setPositions():
///
///   PenetrationTracker tracker(needle, organ);
///   for (;;) {
///     collisions.setPositions(organ, positions);
///     for (const TrackedVertex& v : tracker.update(collisions.queries())) ...
///     collisions.advance();
///   }
///
/// Rule     the last direction is taken with the triangle of the last surface point, which turns
///          with the body. Where the nearest direction is within kMostTurn + m of it, the nearest
///          is taken; m is how far the vertex moved from that surface point, over the root of the
///          last depth times the nearest depth. Else the last direction is kept if it meets the
///          surface at most kMostDepth times as far away as the nearest point is. Else the nearest
///          is taken, and the change is Jumped. So the depth is at most twice the least, and no
///          direction jumps without being marked.
/// Threads  one thread at a time.
class PALPATE_EXPORT PenetrationTracker {
 public:
  PenetrationTracker(GeometryId vertices, GeometryId body);
  PenetrationTracker(PenetrationTracker&&) noexcept;
  PenetrationTracker& operator=(PenetrationTracker&&) noexcept;
  ~PenetrationTracker();

  /// Directions are followed from the last earlier step in which this was called with queries of
  /// the same OctreeBasedCD, however often it is called in this step. Ascending vertices; the span
  /// lives until the next call.
  ///
  /// Errors   those of SpatialQueries::findInsideVertices(); what is remembered stays. InvalidCall
  ///          after a move.
  std::span<const TrackedVertex> update(const SpatialQueries&);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
