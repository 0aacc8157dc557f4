#pragma once

#include <palpate/FrameStatistics.h>

#include "CollisionDetection/PairTable.h"
#include "Search/JobRunner.h"
#include "Search/PairResults.h"
#include "Core/Threads.h"
#include "Core/Trace.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Takes the pairs through a frame: from octrees to candidates to contacts. How a pair is answered
/// is left to its PairWork. Its scratch remembers its peak.
class Frame {
 public:
  using BatchFunction = void (*)(void* context, const CollisionPair&, std::span<const ElementPair>);
  /// What a frame needs besides pairs. trace: null for none.
  struct Context {
    const Threads& threads;
    Engine engine;
    FrameStatistics& statistics;
    Trace* trace = nullptr;
  };

  /// Passes the candidates of each pair to a function, batch by batch, one call at a time.
  void forEach(std::span<PairRecord* const>, const Threads&, BatchFunction, void* context);
  /// Writes the answer of each pair, sorted, to PairRecord::found.
  void detect(std::span<PairRecord* const>, const Context&);
  /// The same for a few pairs at a time in the given order, with track(), until the thread's
  /// deadline is over. The rest is Urgency::isUnfinished.
  void detectInTime(std::uint64_t step, std::span<PairRecord* const>, const Context&);
  /// Writes the answer of each search.
  void detect(std::span<const Search>, const Context&);
  /// Takes the contacts of a pair over into the step with this number.
  void track(PairRecord& record, std::uint64_t step) {
    record.memory.tracker.follow(record.momentIn(step), record.isCurrent(), m_match);
  }
  JobRunner& jobs() { return m_jobs; }

 private:
  std::size_t start(std::span<PairRecord* const>, const Context&);
  void join(std::size_t, PairRecord&, const Context&);

  JobRunner m_jobs;
  PairResults m_results;
  ContactMatch m_match;
};

}  // namespace palpate
