#pragma once

#include <palpate/CollisionData.h>

#include "CollisionDetection/GeometryTable.h"
#include "NarrowPhase/NarrowPhase.h"

namespace palpate {

/// How a pair is answered in this frame.
struct PairPlan {
  Method method = Method::Intersection;  ///< Auto: Proximity and Continuous
  MethodReason reason = MethodReason::Asked;
  double motion = 0;     ///< L: largest of two features, relative to each other
  double tolerance = 0;  ///< L: Auto's
  double nearby = 0;     ///< L: Intersection asks for boxes within this, to know of what was near
  StepPlan step;
  bool overlaps = false;  ///< Auto: Intersection is asked, too, unless the step starts apart
  bool startsIntersecting = false;  ///< known before
  /// Boxes hold the whole step.
  bool swept() const { return method == Method::Continuous || method == Method::Auto; }
};

/// From the settings, which are good, and how the geometries moved, if that matters.
PairPlan planOf(const PairSettings&, const Geometry& a, const Geometry& b, bool moves = true);

/// Whether a pair's meshes are known to be apart where its next step starts, from frame to frame.
class Trust {
 public:
  /// Before a frame's detection; `frame` counts all frames. Sets whether the step's start is asked.
  void start(const PairSettings&, const Geometry& a, const Geometry& b, std::uint64_t frame,
             PairPlan&);
  /// After it, with what the narrow phase has seen. counts: as of anyIntersecting().
  void finish(const PairSettings&, const Geometry& a, const Geometry& b, const PairPlan&,
              const StepFacts&, bool nearby, const MeshPair&, CollisionData::Contents&,
              ContactBuffers& counts);
  /// After a frame whose answer was kept.
  void keep(std::uint64_t frame) { m_frame = frame; }
  void forget() { m_topologyA = 0; }

 private:
  enum class End { Unknown, Apart, Intersecting };

  /// Where bounds on motion do not tell.
  void findEnd(const PairPlan&, const StepFacts&, const MeshPair&, const CollisionData::Contents&,
               ContactBuffers& counts);

  End m_end = End::Unknown;  ///< of the last frame's step
  double m_clearance = 0;    ///< L: Apart by at least
  TrianglePair m_witness;    ///< Intersecting: a pair that does
  std::uint64_t m_frame = 0;
  std::uint64_t m_topologyA = 0, m_topologyB = 0;
  bool m_startsApart = false, m_startsIntersecting = false;  ///< known of this frame's step
  int m_saved = 0;                                           ///< of looks at the step's start
};

}  // namespace palpate
