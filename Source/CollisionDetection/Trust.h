#pragma once

#include <palpate/CollisionData.h>

#include "CollisionDetection/GeometryTable.h"
#include "Mesh/Revision.h"
#include "NarrowPhase/NarrowPhase.h"

#include <optional>

namespace palpate {

/// How a pair is answered in this frame.
struct PairPlan {
  Method method = Method::Intersection;  ///< Auto: Proximity and Continuous
  MethodReason reason = MethodReason::Asked;
  double motion = 0;        ///< L: largest of two features, relative to each other
  double arcDeviation = 0;  ///< L: of both geometries
  double tolerance = 0;     ///< L: Auto's
  double nearby = 0;  ///< L: Intersection asks for boxes within this, to know of what was near
  StepPlan step;
  bool overlaps = false;  ///< Auto: Intersection is asked, too, unless the step starts apart
  bool startsIntersecting = false;  ///< known before
  /// Boxes hold the whole step.
  bool swept() const { return method == Method::Continuous || method == Method::Auto; }
};

/// Whether Method::Continuous answers a pair of these geometries.
bool hasContinuous(const Geometry& a, const Geometry& b);
/// Whether Method::Proximity does.
bool hasProximity(const Geometry& a, const Geometry& b, double thickness);

/// From the settings, which are good, and how the geometries moved, if that matters.
PairPlan planOf(const PairSettings&, const Geometry& a, const Geometry& b, bool moves = true);

/// Whether a pair's meshes are known to be apart where a step starts.
///
/// What was found out is kept with the states of both geometries that it holds for. So it serves
/// the next step, which starts where this one ends, and further detections of the same step.
class Trust {
 public:
  /// Before a detection: decides whether it also tests the step's start.
  void start(const PairSettings&, const Geometry& a, const Geometry& b, PairPlan&);
  /// After it, with what the narrow phase has found. counts: as of anyIntersecting().
  void finish(const PairSettings&, const Geometry& a, const Geometry& b, const PairPlan&,
              const StepFacts&, bool nearby, const MeshPair&, CollisionData::Contents&,
              ContactBuffers& counts);
  void forget();

 private:
  enum class Position { Unknown, Apart, Intersecting };
  /// One state of both geometries.
  struct Known {
    DerivedFrom<8> of;
    Position position = Position::Unknown;
    double clearance = 0;                 ///< L: Apart by at least
    std::optional<TrianglePair> witness;  ///< Intersecting: a pair that does, if known
  };

  /// Where bounds on motion do not tell.
  void findEnd(const PairPlan&, const StepFacts&, const MeshPair&, const CollisionData::Contents&,
               ContactBuffers& counts);

  Known m_atStart, m_atEnd;  ///< of the step last detected
  DerivedFrom<4> m_topologies;
  int m_saved = 0;  ///< tests of the step's start that were earned and not used, times kLook
};

}  // namespace palpate
