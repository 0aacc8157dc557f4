#pragma once

#include <palpate/Settings.h>
#include <palpate/Validity.h>

#include "Mesh/Motion.h"
#include "Mesh/Revision.h"
#include "Mesh/TriangleMesh.h"
#include "NarrowPhase/NarrowPhase.h"

namespace palpate {

/// What the choice of a method, and what makes its answer trusted, depend on of one geometry.
struct GeometryInStep {
  const TriangleMesh& mesh;
  bool isShape;
  double smallestHeight;       ///< L: of a triangle with area, when the topology was set
  MotionRange range;           ///< from before to now
  MotionRange correction;      ///< from `detected` to before
  double arcDeviation;         ///< L: Validity::arcDeviation
  double extent;               ///< L: of the geometry, along any axis of the world
  Revision topology, enabled;  ///< GeometryRevisions
  const Positions& detected;   ///< the end `now` of the last detection
};

/// How a pair is answered in this frame.
struct PairPlan {
  Method method = Method::Intersection;  ///< Auto: Proximity and Continuous
  MethodReason reason = MethodReason::Asked;
  double motion = 0;           ///< L: largest of two features, relative to each other
  double arcDeviation = 0;     ///< L: of both geometries
  double motionTolerance = 0;  ///< L: Auto's
  double nearby = 0;  ///< L: Intersection asks for boxes within this, to know of what was near
  StepPlan step;
  bool overlaps = false;  ///< Auto: Intersection is asked, too, unless the step starts apart
  bool startsIntersecting = false;  ///< known before
  /// Boxes hold the whole step.
  bool swept() const { return method == Method::Continuous || method == Method::Auto; }
};

/// Whether Method::Continuous answers a pair of these geometries.
bool hasContinuous(const GeometryInStep& a, const GeometryInStep& b);
/// Whether Method::Proximity does.
bool hasProximity(const GeometryInStep& a, const GeometryInStep& b, double thickness);
/// Whether both are of triangles. Bounds on motion hold for these, as they have no radius.
bool knowsSides(const GeometryInStep& a, const GeometryInStep& b);

/// From the settings, which are good, and how the geometries moved, if that matters.
PairPlan planOf(const PairSettings&, const GeometryInStep& a, const GeometryInStep& b,
                bool moves = true);

}  // namespace palpate
