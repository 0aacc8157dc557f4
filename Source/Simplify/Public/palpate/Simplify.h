#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <functional>
#include <vector>

namespace palpate {

/// A value out of range throws InvalidSettings.
struct SimplifySettings {
  /// L, positive; at least 2^-30 of the mesh's largest coordinate and of its box's longest side.
  double maxDistance = 0.0;
  int threads = 0;  ///< in [0, 1024]; 0: one per core; does not change the result
  /// Gets an increasing estimate on the calling thread. False: simplify() throws Cancelled.
  std::function<bool(double fraction)> progress{};
};

struct SimplifiedMesh {
  std::vector<Eigen::Vector3d> positions;  ///< L
  std::vector<Triangle> triangles;         ///< wound as those of the mesh, at most as many
  /// L, at most maxDistance: a proven bound of the triangles' distance from the mesh's surface.
  double distance = 0.0;
  int rounds = 0;  ///< number of simplifications, at most 24
};

/// Simplifies a closed, consistently oriented mesh. Exact arithmetic proves of the result that it
/// encloses each point of the mesh's surface and inside (winding number not 0), and touches none.
/// Each point of its surface is within `distance` of the mesh's, also proven. Where the mesh cannot
/// be coarser, its triangles move outward. Inner shells vanish.
/// Errors   NonFinitePosition; IndexOutOfRange; TooLarge: 2^28 vertices or triangles; NotClosed,
///          also without triangles; InvalidSettings, also for a longest side outside [2^-200,
///          2^200]; UnsupportedMethod, with two triangles, for a mesh that meets itself where the
///          proof fails; NotAvailable, with a place, if the proof fails in all rounds; Cancelled.
/// Source   Garland and Heckbert, Surface simplification using quadric error metrics, SIGGRAPH
///          1997, by meshoptimizer. Difference: the result is moved outward and certified.
PALPATE_EXPORT SimplifiedMesh simplify(const TriangleMeshView&, const SimplifySettings&);

}  // namespace palpate
