#pragma once

#include "CollisionDetection/Frame.h"
#include "CollisionDetection/FreeMotionSearch.h"
#include "CollisionDetection/SceneOctrees.h"
#include "Core/Stopping.h"

#include <span>
#include <vector>

namespace palpate {

/// The stages of a detection, in their order. A detection that throws leaves the last answers and
/// results.
class Detection {
 public:
  Detection(const Settings& settings, const Threads& threads, const GeometryTable& geometries,
            const PairTable& pairs, SceneOctrees& octrees)
      : m_settings(settings),
        m_threads(threads),
        m_geometries(geometries),
        m_pairs(pairs),
        m_octrees(octrees) {}

  /// Answers all outdated pairs, and finds free motions. The token ends the search for contacts
  /// and for free motions, and nothing else. Returns the statistics, but for those of geometries
  /// and memory. last: of the detection before, whose memory is used again.
  FrameStatistics run(StopScope::Token, Trace*, FrameStatistics& last);
  /// Answers those of the searches that are outdated. The pairs' answers stay as they are.
  void run(SeparateSearches);
  /// Passes the candidates of one pair, or of all if it is null, batch by batch. Call after an
  /// update of the octrees.
  void forEachCandidateBatch(const PairRecord* only, Frame::BatchFunction, void* context);
  /// Adds the contacts of all last answers.
  void countContacts(FrameStatistics&) const;

  FreeMotionSearch& freeMotions() { return m_freeMotions; }
  const FreeMotionSearch& freeMotions() const { return m_freeMotions; }
  void releaseMemory() { m_frame = Frame(); }

 private:
  std::span<PairRecord* const> outdatedPairs();
  void completePlans(std::span<PairRecord* const>, StopScope::Token);
  bool updateProxies(std::span<PairRecord* const>);
  void findContacts(std::span<PairRecord* const>, FrameStatistics&, Trace*);
  void completeAnswers(std::span<PairRecord* const>, bool hasDeadline);
  void listUnfinished(std::span<PairRecord* const>);
  void keepUnfinished(std::span<PairRecord* const>, FrameStatistics& next,
                      FrameStatistics& last) noexcept;
  void commit(std::span<PairRecord* const>) noexcept;
  Frame::Context context(FrameStatistics& statistics, Trace* traced) const {
    return {m_settings.engine == Engine::Octree ? m_threads : m_singleThread, m_settings.engine,
            statistics, traced};
  }

  const Settings& m_settings;
  const Threads& m_threads;
  const Threads m_singleThread{1};
  const GeometryTable& m_geometries;
  const PairTable& m_pairs;
  SceneOctrees& m_octrees;
  Frame m_frame;
  FreeMotionSearch m_freeMotions;
  std::vector<PairRecord*> m_selected;       ///< pairs of the call that runs
  std::vector<UnfinishedPair> m_unfinished;  ///< of the detection that runs
  std::vector<Search> m_outdatedSearches;    ///< of SeparateSearches
};

}  // namespace palpate
