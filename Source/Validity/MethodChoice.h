#pragma once

#include <palpate/DistanceField.h>
#include <palpate/Settings.h>
#include <palpate/Validity.h>

#include "Validity/Support.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Mesh/Motion.h"
#include "Mesh/Revision.h"
#include "Mesh/TriangleMesh.h"

#include <optional>

namespace palpate {

/// The data of one geometry from which a method is chosen and Validity::trusted is decided.
struct GeometryInStep {
  const TriangleMesh& mesh;
  double smallestHeight;   ///< L: of all triangles with area, in the shape at rest
  MotionRange range;       ///< from before to now
  MotionRange correction;  ///< from `detected` to before
  double arcDeviation;     ///< L: Validity::arcDeviation
  double extent;           ///< L: of the geometry, along any axis of the world
  ElementsState elements;
  const Positions& detected;   ///< the end `now` of the last detection
  const CutsSince& cuts;       ///< since then
  const DistanceField* field;  ///< null if there is none
  GeometryType type() const { return mesh.topology.type; }
};

/// The method of a pair in this frame, and what the narrow phase must find out for it.
struct PairPlan {
  PairKind kind = PairKind::Meshes;
  Method method = Method::Intersection;  ///< Auto: Proximity and Continuous
  MethodReason reason = MethodReason::Requested;
  double motion = 0;           ///< L: largest motion of two features relative to each other
  double arcDeviation = 0;     ///< L: of both geometries
  double motionTolerance = 0;  ///< L: Auto's
  /// L: for Intersection the traversal finds triangles whose boxes are up to this far apart. Where
  /// there are any, but no intersections, the answer is not trusted.
  double searchDistance = 0;
  StepPlan step;
  bool runsIntersection = false;    ///< Auto: Intersection runs, too, if the start intersects
  double proxyThickness = 0;        ///< L, AttachedProxy: up to which leaves report contacts
  bool startsIntersecting = false;  ///< triangles are known to intersect at the step's start
  /// Whether the boxes enclose the motion over the whole step.
  bool swept() const { return method == Method::Continuous || method == Method::Auto; }
};

/// Whether a method answers the pair with this thickness and the radii of both.
bool answers(Method, double thickness, const GeometryInStep& a, const GeometryInStep& b);
/// Whether both geometries have triangles.
bool haveTriangles(const GeometryInStep& a, const GeometryInStep& b);
/// Whether elements may intersect although no features touch: an edge pierces a triangle. All other
/// geometries that intersect have features, or a feature and a shape, at distance 0.
bool mayPierce(const GeometryInStep& a, const GeometryInStep& b);

/// Whether the field of the second geometry answers a pair by Method::DistanceField, not that of
/// the first: an added field answers, else the second mesh's if both have one.
inline bool answersByFieldOfSecond(GeometryType first, const DistanceField* ofSecond) {
  return ofSecond && first != GeometryType::Field;
}

/// Plans a pair's frame from valid settings, the row of the table that answers them, and from how
/// the geometries moved. moves: whether that motion is used; otherwise it counts as 0.
PairPlan planOf(const SupportedPairs&, const PairSettings&, const GeometryInStep& a,
                const GeometryInStep& b, bool moves = true);

/// Whether the field can answer at this thickness: all contacts outside the body are in its band.
bool isWithinBand(const DistanceField&, double thickness, double largestRadius);
/// Auto: the plan by which an attached field may answer instead of the plan `exact`, at rest or in
/// a slow step. In a step that moves, no impact may be missed: the geometries must be known to be
/// further apart at its end than PairPlan::motion. None where the settings do not allow it.
std::optional<PairPlan> planByField(const PairSettings&, const GeometryInStep& a,
                                    const GeometryInStep& b, const PairPlan& exact);
/// The same for an attached surface proxy, which the settings allow.
PairPlan planByProxy(const PairSettings&, PairPlan exact);

}  // namespace palpate
