#pragma once

#include <palpate/Settings.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairTable.h"
#include "Search/JobRunner.h"
#include "Core/Threads.h"

#include <vector>

namespace palpate {

/// Finds the free motions of all geometries (PairSettings::freeMotionReach), beside the work on
/// contacts: in a search of its own, whose distance includes the reach.
class FreeMotionSearch {
 public:
  /// Writes Geometry::nextFreeMotion, unless nothing changed since the last commit(). The octrees
  /// must be up to date. Returns whether the search ended in time. If it did not, free motions
  /// follow from Urgency::distanceBound, also those of geometries with an unfinished pair.
  bool find(const GeometryTable&, const PairTable&, Engine, const Threads&, JobRunner&);
  /// Makes what find() wrote the result.
  void commit(const GeometryTable&) noexcept;
  /// A pair, and its state for which the results hold.
  struct Known {
    CollisionPair pair;
    PairState state;
  };
  /// One that is no pair if the results hold for no state.
  std::vector<Known> known() const {
    constexpr GeometryId kNone{kNoElement};
    return m_holds ? m_known : std::vector<Known>{{{kNone, kNone, {}}, {}}};
  }
  void restore(std::vector<Known>& known) noexcept {
    m_known.swap(known);
    m_holds = true;
  }
  void releaseMemory() {
    const bool holds = m_holds && m_known.empty();
    *this = FreeMotionSearch();
    m_holds = holds;
  }

 private:
  bool isKnown(const PairTable&) const;
  void start(const GeometryTable&, const PairTable&);
  void search(const PairTable&, Engine, const Threads&, JobRunner&);

  std::vector<Known> m_known;
  bool m_holds = true;             ///< the results are those of all known pairs, or of none
  bool m_isNew = false;            ///< commit() has something to commit
  std::vector<Geometry*> m_boxed;  ///< each once
};

}  // namespace palpate
