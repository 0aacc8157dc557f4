#pragma once

#include "Search/JobScratch.h"
#include "Search/PairWork.h"
#include "Octree/Traversal.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"
#include "Core/Trace.h"

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace palpate {

/// Runs the work of several searches in jobs, on all threads, and joins what they found. It knows
/// nothing of who asks. Its scratch remembers its peak.
class JobRunner {
 public:
  /// Forgets the work of earlier searches.
  void begin();
  /// Adds the work of a search of this pair, of which startOf(work, frame) returns the number of
  /// jobs.
  template <class Start>
  void add(const CollisionPair& pair, PairWork work, const Threads& threads, Engine engine,
           Start&& startOf) {
    m_works.push_back({&pair, std::move(work), m_places.size()});
    Work& added = m_works.back();
    added.jobCount = startOf(added.work, FrameStart{threads, engine, m_nodePairs, m_stack});
    addPlaces(added.jobCount);
  }
  void add(const CollisionPair& pair, PairWork work, const Threads& threads, Engine engine);

  /// Runs all jobs, in as many rounds as their works have. With a deadline, jobs begin in the order
  /// of their works. trace: null for none.
  void run(const Threads&, Trace* trace);
  /// Calls f(i, job, scratch) for each job of the i-th work, on all threads.
  template <class F>
  void forEachJob(const Threads& threads, F&& f) {
    threads.forEach(m_places.size(),
                    [&](std::size_t i) { f(m_places[i].work, m_places[i].job, *m_jobs[i]); });
  }

  /// Writes the answer of the i-th work, and adds what its jobs counted.
  void join(std::size_t i, Answer&, const FrameJoin&);
  /// Adds the wall-clock time of starting and running all works to the stages. Threads work on both
  /// stages at once. The time is therefore divided in proportion to the work of each stage.
  void addTimes(double wall, FrameStatistics&) const;
  double millisecondsOf(std::size_t i) const;  ///< the time that the jobs of the i-th work took

  std::size_t size() const { return m_works.size(); }  ///< number of works
  std::size_t jobCount() const { return m_places.size(); }
  const PairWork& work(std::size_t i) const { return m_works[i].work; }
  /// Of the i-th work: its jobs with what they found.
  Jobs jobsOf(std::size_t i) const {
    return std::span(m_jobs).subspan(m_works[i].firstJob, m_works[i].jobCount);
  }

 private:
  struct Work {
    const CollisionPair* pair;
    PairWork work;
    std::size_t firstJob, jobCount = 0;
    bool runs = false;  ///< in the present round
  };
  struct Place {
    std::size_t work, job;  ///< indices in m_works, and among its jobs
  };
  void addPlaces(std::size_t count);
  bool startRound(int round);

  std::vector<Work> m_works;
  std::vector<Place> m_places;  ///< of the jobs in use
  std::vector<std::unique_ptr<JobScratch>>
      m_jobs;  ///< those in use first, those of a work together
  Buffer<NodePair> m_nodePairs;
  TraversalStack m_stack;
};

}  // namespace palpate
