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
  std::vector<Known>& known() { return m_known; }
  const std::vector<Known>& known() const { return m_known; }

 private:
  bool isKnown(const PairTable&) const;
  void start(const GeometryTable&, const PairTable&);
  void search(const PairTable&, Engine, const Threads&, JobRunner&);

  std::vector<Known> m_known;
  bool m_isNew = false;            ///< commit() has something to commit
  std::vector<Geometry*> m_boxed;  ///< each once
};

}  // namespace palpate
