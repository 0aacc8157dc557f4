#pragma once

#include "CollisionDetection/SeparateSearch.h"
#include "Octree/Forest.h"
#include "Core/Trace.h"

#include <atomic>

namespace palpate {

/// Brings the octrees of all geometries to the positions now, or to the whole step where the plan
/// of a pair needs it. Knows for which positions they hold, shows them, and counts updates.
///
/// After an update that throws, octrees are outdated and not shown.
class SceneOctrees {
 public:
  SceneOctrees(const Settings& settings, const Threads& threads, const GeometryTable& geometries,
               const PairTable& pairs)
      : m_settings(settings), m_threads(threads), m_geometries(geometries), m_pairs(pairs) {}

  /// Why octrees are updated. Explicit calls of the user count as rebuilt or refitted only the
  /// trees that they changed. The counts of a frame include updates for queries. Only plans of a
  /// frame include the motion of all; others include the motion on which candidates depend.
  enum class UpdateFor : std::uint8_t { Queries, User, Frame, Separate };
  /// Asks by the plans that are expected, and updates what these need. traced: of a detection, or
  /// null. separate: asked instead of the pairs.
  void update(UpdateFor, Trace* traced = nullptr, SeparateSearches separate = {});

  /// Whether all octrees hold for the positions now. Any thread may ask.
  bool areCurrent() const { return m_state == m_geometries.state(); }
  bool anyLags() const;
  /// Whether one thread made the last update. Its cache then has the data.
  bool wereUpdatedByOneThread() const { return m_wereUpdatedByOneThread; }
  const LooseOctree& view() const { return m_shown.view; }
  void updateView();  ///< after a geometry was removed
  /// Statistics of the updates since startCounts(): trees and times.
  const FrameStatistics& counts() const { return m_counts; }
  void startCounts() { m_hasCounts = false; }
  void reserve(std::size_t geometries);  ///< so that restart() and the next updates do not allocate
  void restart();                        ///< the geometries are others

 private:
  using IsDue = bool (*)(const Geometry&);
  bool needsNone(const PairRecord&) const;
  void markSkipped(bool maySkip);
  void planAndLag(UpdateFor, Trace*, SeparateSearches);
  void updateTrees(Trace*, IsDue = nullptr);
  void findOutdated(double scale, IsDue);
  void count(double milliseconds);

  const Settings& m_settings;
  const Threads& m_threads;
  const GeometryTable& m_geometries;
  const PairTable& m_pairs;
  CountedVector<Geometry*> m_outdated;  ///< scratch of updateTrees(), the largest first
  bool m_wereUpdatedByOneThread = false;
  /// m_geometries.state() for which all octrees hold; 0: for none.
  std::atomic<std::uint64_t> m_state = 0;
  LooseOctree::State m_shown;
  FrameStatistics m_counts;
  bool m_hasCounts = false;  ///< there was an update since startCounts()
};

}  // namespace palpate
