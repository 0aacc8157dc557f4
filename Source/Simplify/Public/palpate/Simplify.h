#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <functional>
#include <vector>

namespace palpate {

/// Settings of simplify(). A value out of range throws InvalidSettings.
struct SimplifySettings {
  /// L, positive: how far the result may be from the mesh. At least 2^-30 of the largest coordinate
  /// of the mesh and of the longest side of its box.
  double maxDistance = 0.0;
  /// Number of threads, in [0, 1024]; 0: one per core. The result does not depend on it.
  int threads = 0;
  /// Called from time to time by the thread that calls simplify(), with an estimate in [0, 1] of
  /// the work done, which never decreases. simplify() throws Cancelled if it returns false.
  std::function<bool(double fraction)> progress{};
};

/// A closed surface around a closed mesh.
struct SimplifiedMesh {
  std::vector<Eigen::Vector3d> positions;  ///< L
  /// Wound as those of the mesh. There are at most as many.
  std::vector<Triangle> triangles;
  /// L: no point of these triangles is further than this from the mesh's surface. At most
  /// maxDistance. This is a proven bound, not the largest distance itself.
  double distance = 0.0;
  /// How often the mesh was simplified; each time after the first, more finely where the proof had
  /// failed. At most 24.
  int rounds = 0;
};

/// Simplifies a closed, consistently oriented mesh to one that encloses it. Both properties are
/// proven for the result, in exact arithmetic (Docs/Simplification.md):
///   encloses  each point of the mesh's surface, and each point inside the mesh, is strictly inside
///             the result. Inside is where the winding number is not 0. The surfaces have no point
///             in common.
///   near      each point of the result's surface is within `distance` of the mesh's surface.
///
/// Where a mesh cannot be made coarser within maxDistance, the result has its triangles, moved
/// outward. Shells inside the mesh have no counterpart in the result.
/// Errors   NonFinitePosition; IndexOutOfRange for a vertex index; TooLarge for more than 2^28
///          vertices or triangles; NotClosed, also for a mesh without triangles; InvalidSettings,
///          also for a mesh whose longest side is not in [2^-200, 2^200]; UnsupportedMethod, with
///          two triangles, for a mesh that crosses or touches itself where the proof fails;
///          NotAvailable, with a place, if the proof fails in all rounds; Cancelled. Messages name
///          the mesh geometry 0.
/// Cost     Docs/Simplification.md has measured times.
/// Source   Garland and Heckbert, Surface simplification using quadric error metrics, SIGGRAPH
///          1997, as meshoptimizer implements it. Difference: the result is moved outward and
///          certified, and parts that fail are simplified again.
PALPATE_EXPORT SimplifiedMesh simplify(const TriangleMeshView&, const SimplifySettings&);

}  // namespace palpate
