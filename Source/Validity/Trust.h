#pragma once

#include <palpate/CollisionData.h>

#include "Mesh/Revision.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Validity/MethodChoice.h"

#include <optional>

namespace palpate {

/// Whether a pair's meshes are known to be apart where a step starts.
///
/// What was found out is kept with the states of both geometries that it holds for. So it serves
/// the next step, which starts where this one ends, and further detections of the same step.
class Trust {
 public:
  /// Before a detection: decides whether it also tests the step's start.
  void start(const PairSettings&, const GeometryInStep& a, const GeometryInStep& b, PairPlan&);
  /// After it, with what the narrow phase has found. counts: as of anyIntersecting().
  void finish(const PairSettings&, const GeometryInStep& a, const GeometryInStep& b,
              const PairPlan&, const StepFacts&, bool nearby, const MeshPair&,
              CollisionData::Contents&, ContactBuffers& counts);
  void forget();

 private:
  enum class Position { Unknown, Apart, Intersecting };
  /// One state of both geometries.
  struct Known {
    DerivedFrom<8> of;
    Position position = Position::Unknown;
    double clearance = 0;                ///< L: Apart by at least
    std::optional<ElementPair> witness;  ///< Intersecting: a pair that does, if known
  };

  /// Where bounds on motion do not tell.
  void findEnd(const PairPlan&, const StepFacts&, const MeshPair&, const CollisionData::Contents&,
               ContactBuffers& counts);

  Known m_atStart, m_atEnd;  ///< of the step last detected
  DerivedFrom<4> m_topologies;
  int m_saved =
      0;  ///< tests of the step's start that were earned and not used, times kFramesPerCheck
};

}  // namespace palpate
