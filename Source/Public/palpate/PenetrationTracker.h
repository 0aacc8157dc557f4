#pragma once

#include <palpate/Export.h>
#include <palpate/Meshes.h>
#include <palpate/SpatialQueries.h>
#include <palpate/Types.h>

#include <memory>
#include <span>

namespace palpate {

/// The *nearest direction* leads to the nearest surface point; the *last direction* is that of the
/// last step, turned with the body.
enum class DirectionChange {
  /// The nearest direction. The vertex was not inside in the last step, or topology was set since.
  Entered,
  None,  ///< the nearest direction; it turned no further than motion explains
  /// The last direction, as the nearest would have turned further than motion explains.
  Kept,
  /// The nearest, which turned further: the last one does not leave within kMaxDepthRatio.
  Jumped
};
PALPATE_EXPORT const char* toString(DirectionChange) noexcept;  ///< its name, or "unknown"

/// A vertex inside a body with a penetration direction that is stable over time.
struct TrackedVertex {
  /// Largest turn beyond what motion explains: a difference of unit vectors. 0.5 is 29 degrees.
  static constexpr double kMaxTurn = 0.5;
  /// Largest depth of a kept direction, as a multiple of the distance to the surface.
  static constexpr double kMaxDepthRatio = 2.0;

  InsideVertex penetration;  ///< Kept: where the last direction leaves the body
  InsideVertex nearest;      ///< as findInsideVertices() finds it
  DirectionChange change;
  friend bool operator==(const TrackedVertex&, const TrackedVertex&) = default;
};

/// Finds the vertices of one geometry that are inside another, a closed body, with directions that
/// are stable over time. Call update() in each step, after setPositions(), from one thread at a
/// time.
/// Laws     (1) the depth is at most kMaxDepthRatio times the least depth.
///          (2) only a direction that Jumped turns further than kMaxTurn + m. m is the vertex's
///          distance from its last surface point over the root of the last times the least depth.
class PALPATE_EXPORT PenetrationTracker {
 public:
  /// The ids are those of the OctreeBasedCD whose queries update() receives and checks.
  PenetrationTracker(GeometryId vertices, GeometryId body);
  PenetrationTracker(PenetrationTracker&&) noexcept;
  PenetrationTracker& operator=(PenetrationTracker&&) noexcept;
  ~PenetrationTracker();

  /// The directions of this step, by vertex, valid until the next call. Repeated calls in a step
  /// continue from the last earlier step of the same OctreeBasedCD. Throws as findInsideVertices().
  std::span<const TrackedVertex> update(const SpatialQueries&);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
