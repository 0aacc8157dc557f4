#pragma once

#include <palpate/Types.h>

#include "CollisionDetection/PositionBodies.h"
#include "CollisionDetection/StepSets.h"
#include "Bodies/Body.h"
#include "Shapes/PlacedShape.h"
#include "Mesh/Motion.h"
#include "Mesh/Positions.h"
#include "Mesh/Revision.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Threads.h"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

/// The two ends of one geometry's step: the only writer of TriangleMesh::before and now, and of
/// a PlacedShape's.
///
/// The end `now` is what was set last. The end `before` is `now` of the last advance(), unless it
/// was given. While the geometry is new (it was added or its topology was set in this step) the end
/// `before` follows `now` instead. Body positions and transform follow this rule separately, so the
/// order of the calls within a step does not matter.
///
/// Positions and transforms that equal those of another end take its revision: what was computed
/// for them stays valid.
///
/// Errors   a call that throws changes nothing.
class GeometryStep {
 public:
  explicit GeometryStep(Revision::Counter revisions = {}) : m_revisions(revisions) {}

  /// Positions of a new geometry or topology, at both ends.
  void start(TriangleMesh&, Positions::Body) noexcept;
  /// The shape of a new analytical geometry, not placed.
  void startShape(const Shape&);
  /// moved: if not null, receives the motion of the step where both ends are unplaced.
  void setPositions(const GeometryLabel&, TriangleMesh&,
                    std::optional<std::span<const Eigen::Vector3d>> before,
                    std::span<const Eigen::Vector3d> now, const Threads&,
                    std::optional<MotionRange>* moved);
  /// The same for the positions now of some vertices, at least one.
  /// Cost     linear in them if the last calls were like it, else in all vertices.
  void setSomePositions(const GeometryLabel&, TriangleMesh&, std::size_t first,
                        std::span<const Eigen::Vector3d> now, const Threads&);
  /// shape: null if there is none.
  void setTransform(const GeometryLabel&, TriangleMesh&, PlacedShape* shape,
                    const std::optional<Pose>& before, const Pose& now);
  /// Makes room for new vertices, and for a cut of so many elements.
  /// Cost     that of a copy of all positions where others use them, or where the room ends.
  void reserveCut(TriangleMesh&, std::size_t newVertices, std::size_t goneElements);
  /// After a cut of elements from `before` to `after`, of which there were `count`: appends new
  /// vertices, for which there is room. They are at rest in this step. gone: as CutsSince::gone.
  void cut(TriangleMesh&, std::span<const Eigen::Vector3d> newVertices, const ElementsState& before,
           std::size_t count, const ElementsState& after,
           std::span<const std::pair<std::uint32_t, Triangle>> gone) noexcept;
  const CutsSince& cutsSinceDetection() const { return m_cuts; }
  /// Whether cutsSinceDetection() will keep what is gone after a cut of these elements.
  bool continuesCuts(const ElementsState& elements) const {
    return m_cuts.gone.empty() || m_cuts.after == elements;
  }
  /// The end `now` becomes `before`.
  void advance(TriangleMesh&, PlacedShape* shape) noexcept;

  /// Puts the end `now` back to what it was in this step, with its revisions.
  void restoreNow(TriangleMesh&, PlacedShape*, const Positions& now) noexcept;

  /// Frees arrays that only the next calls need.
  void releaseMemory() { m_bodies.releaseMemory(); }

  /// A detection has used the end `now`.
  void recordDetection(const TriangleMesh& mesh) noexcept {
    m_detected = mesh.now;
    m_sets.isDetected = true;
    m_cuts.after = {};
    m_cuts.gone.clear();
  }
  /// The end `now` of the last detection; a solver may have corrected it since.
  const Positions& detected() const { return m_detected; }
  bool isNew() const { return m_isNew; }
  bool setsAddUp() const { return m_sets.addUp; }  ///< StepSets

  /// All on which the next calls depend.
  struct State {
    Positions now, before, detected;
    bool isNew = true, bodyGiven = false, transformGiven = false;
    StepSets sets{};
  };
  State state(const TriangleMesh&) const;
  void restore(TriangleMesh&, PlacedShape*, const State&) noexcept;
  Revision nextRevision() { return m_revisions.next(); }

 private:
  void setBody(TriangleMesh&, Positions& end, const PositionBodies::Checked&) noexcept;
  void append(TriangleMesh&, std::span<const Eigen::Vector3d>) noexcept;
  std::array<Positions*, 3> ends(TriangleMesh& mesh) {
    return {&mesh.now, &mesh.before, &m_detected};
  }
  void place(TriangleMesh&, Positions& end, const Pose&) noexcept;
  void noteSet(const TriangleMesh&, const Positions& last, bool begins) noexcept;

  Positions m_detected;
  CutsSince m_cuts;
  bool m_isNew = true;
  bool m_bodyGiven = false, m_transformGiven = false;  ///< `before` was given in this step
  StepSets m_sets;
  Revision::Counter m_revisions;
  PositionBodies m_bodies;
  std::optional<Shape> m_spare, m_spareBefore;  ///< hold new placements until nothing can throw
};

}  // namespace palpate
