#pragma once

#include <palpate/FrameStatistics.h>

#include "CollisionDetection/JobScratch.h"
#include "CollisionDetection/PairResults.h"
#include "CollisionDetection/PairTable.h"
#include "CollisionDetection/PairWork.h"
#include "Octree/Traversal.h"
#include "Core/Threads.h"
#include "Core/Trace.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace palpate {

/// Takes the pairs through a frame: from octrees to candidates to contacts. How a pair is answered
/// is left to its PairWork. Its scratch remembers its peak.
class Frame {
 public:
  using BatchFunction = void (*)(void* context, const CollisionPair&, std::span<const ElementPair>);
  /// Passes the candidates of each pair to a function, batch by batch, one call at a time.
  void forEach(std::span<PairRecord* const>, const Threads&, BatchFunction, void* context);
  /// Writes the contacts of each pair, sorted, to PairRecord::next.
  /// trace: null for none.
  void detect(std::span<PairRecord* const>, const Threads&, FrameStatistics&, Trace* trace);
  /// The same for a few pairs at a time in the given order, with track(), until the thread's
  /// deadline is over. The rest is PairRecord::isUnfinished.
  void detectInTime(std::uint64_t step, std::span<PairRecord* const>, const Threads&,
                    FrameStatistics&, Trace*);
  /// Writes the same results, found by testing every feature against every other.
  void detectByBruteForce(std::span<PairRecord* const>, FrameStatistics&, Trace*);
  /// Takes the contacts of a pair over into the step with this number (PairRecord::track()).
  void track(PairRecord& record, std::uint64_t step) { record.track(step, m_match); }

 private:
  struct Pair {
    PairRecord* record;
    PairWork work;
    std::size_t firstJob, jobCount = 0;
    bool runs = false;  ///< in the present round
  };
  /// The pair of a job, by its index in m_pairs, and the job's number in it.
  struct Place {
    std::size_t pair, job;
  };
  template <class Start>
  void start(std::span<PairRecord* const>, const Threads&, Start&&);
  Jobs jobsOf(const Pair& pair) const {
    return std::span(m_jobs).subspan(pair.firstJob, pair.jobCount);
  }
  void runRounds(const Threads&, Trace*);
  void addTimes(double wall, FrameStatistics&) const;
  void join(Pair&, const FrameJoin&);

  std::vector<Pair> m_pairs;
  std::vector<Place> m_places;  ///< of the jobs in use
  std::vector<std::unique_ptr<JobScratch>>
      m_jobs;  ///< those in use first, those of a pair together
  Buffer<NodePair> m_nodePairs;
  TraversalStack m_stack;
  PairResults m_results;
  ContactMatch m_match;
};

}  // namespace palpate
