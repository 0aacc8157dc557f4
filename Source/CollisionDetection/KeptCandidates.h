#pragma once

#include <palpate/Settings.h>

#include "CollisionDetection/Geometry.h"
#include "Search/KeptPairs.h"
#include "Search/Question.h"
#include "Validity/MethodChoice.h"
#include "Mesh/Revision.h"

#include <array>
#include <cstddef>

namespace palpate {

struct PairMoment;
struct PairRecord;

/// Decides, from detection to detection, whether the candidates of a pair are those of KeptPairs: a
/// part of the pair's memory.
class KeptCandidates {
 public:
  /// Decides by the expected plan for a detection, and whether lists go on after a change of
  /// elements. Allocates nothing.
  void plan(const PairRecord&, const PairPlan& expected, const Settings&);
  bool answers() const { return m_answers; }  ///< the detection finds its candidates in lists
  /// Whether the detection does so, or makes lists.
  bool areInUse() const { return m_answers || m_gathers; }
  /// After plan(): whether the detection of the pair needs no octree, so that boxes may lag behind
  /// the positions.
  bool needsNoOctree(const PairRecord&) const;
  /// Call once the geometries' pieces have moved on.
  void addMotion(const PieceMotion& a, const PieceMotion& b) {
    if (m_lists.isActive()) m_lists.addMotion(a, b);
  }
  /// The octrees of geometries that were cut are up to date: searches if one was built anew.
  void reviewCut(const PairRecord&);
  /// The plan is complete: searches if it differs too much from the expected one.
  void reviewPlan(const PairRecord&);
  /// For the search of the detection.
  KeptSource source(const PairRecord&);
  /// Returns candidates that the last detection did not count: to count takes longer than to keep
  /// them. Call before the elements or floats of a geometry change.
  std::size_t countCandidates(const PairRecord&);
  /// What the last detection worked on: candidates and feature pairs.
  std::size_t workedPairs() const { return m_workedPairs; }
  void takeOver(KeptCandidates& former) noexcept;

  void startStep(const PairMoment&) { m_countIsPending = false; }
  void commit(const PairMoment&) noexcept;
  void skip(const PairMoment&) noexcept {}
  void forget() noexcept {}
  void release(bool all) {
    if (all || !areInUse()) m_lists.releaseMemory();
  }
  template <class File>
  void describe(File&, PairRecord&, const auto&) {}

 private:
  KeptPairs m_lists;
  bool m_answers = false;         ///< this detection's candidates are those of the lists
  bool m_gathers = false;         ///< they are searched, and some go to the lists
  bool m_followsCut = false;      ///< elements are others than those of the last detection
  bool m_countIsPending = false;  ///< the candidates of the lists were not counted yet
  int m_slowFrames = 0;           ///< consecutive detections in which candidates could be kept
  double m_recentSpeed = 0;       ///< L: PairPlan::motion, recently the largest that was slow
  std::size_t m_searchedCandidates = 0;     ///< of the last search
  std::size_t m_workedPairs = 0;            ///< of the last detection of the pair
  int m_pauseFrames = 0;                    ///< detections for which candidates are not kept
  int m_nextPause = 0;                      ///< how many that are the next time
  std::array<ElementsState, 2> m_elements;  ///< those of a and b in the lists
};

}  // namespace palpate
