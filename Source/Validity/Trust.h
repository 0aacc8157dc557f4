#pragma once

#include <palpate/CollisionData.h>

#include "Validity/MethodChoice.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Mesh/Revision.h"

#include <array>
#include <optional>

namespace palpate {

/// Whether a pair's meshes are known to be apart where a step starts.
///
/// Each result is stored with the states of both geometries for which it holds. It therefore also
/// serves the next step, which starts where this one ends, and further detections of the same step.
class Trust {
 public:
  /// Call before a detection. Decides whether the initial intersection check runs.
  void start(const PairSettings&, const GeometryInStep& a, const GeometryInStep& b, PairPlan&);
  /// Call after the detection, with the results of the narrow phase. Writes Contents::validity.
  /// nearby: whether any boxes overlap at the thickness of the traversal. counts: as for
  /// anyIntersecting().
  void finish(const PairSettings&, const GeometryInStep& a, const GeometryInStep& b,
              const PairPlan&, const StepFacts&, bool nearby, const MeshPair&,
              CollisionData::Contents&, ContactBuffers& counts);
  void forget();
  /// For saved states. revisions: SavedRevisions of the pair's geometries.
  template <class File>
  void describe(File&, const auto& revisions);

 private:
  struct SurfaceState {
    ElementsState elements;
    PositionsState positions;
    friend bool operator==(const SurfaceState&, const SurfaceState&) = default;
  };
  static std::array<SurfaceState, 2> statesOf(const GeometryInStep& a, const Positions& ofA,
                                              const GeometryInStep& b, const Positions& ofB);
  /// The same of what both were before the cuts since the last detection.
  static SurfaceState beforeCuts(const GeometryInStep&, const Positions&);
  bool wereApartBeforeCuts(const GeometryInStep& a, const GeometryInStep& b) const;
  /// One state of both geometries.
  struct KnownState {
    DerivedFrom<std::array<SurfaceState, 2>> version;
    std::optional<Meeting> meeting;      ///< none: unknown
    double clearance = 0;                ///< L: if Apart, by at least this distance
    std::optional<ElementPair> witness;  ///< if Piercing, a pair that does, if known
  };

  void findEnd(const PairSettings&, const PairPlan&, const StepFacts&, const MeshPair&,
               const CollisionData::Contents&, bool trustedIfStraight, bool isProvenApart,
               ContactBuffers& counts);
  /// Determines m_atEnd where bounds on motion do not.
  void followToEnd(const PairPlan&, const StepFacts&, const MeshPair&,
                   const CollisionData::Contents&, ContactBuffers& counts);

  KnownState m_atStart, m_atEnd;  ///< of the step last detected
  DerivedFrom<std::array<ElementsState, 2>> m_topologies;
  bool m_isUnwelded = false;  ///< Validity::unwelded, for these topologies
  int m_checkCredit = 0;  ///< initial intersection checks saved for later, times kFramesPerCheck
};

}  // namespace palpate
