#pragma once

#include "Search/JobScratch.h"
#include "Search/PairResults.h"
#include "Search/Question.h"
#include "Search/TreeCandidates.h"
#include "NarrowPhase/FeaturePairs.h"
#include "Bodies/Body.h"
#include "Bodies/OctreeFrame.h"
#include "Octree/Traversal.h"
#include "Core/MemoryBudget.h"

#include <cstddef>
#include <span>

namespace palpate {

/// Work on the candidates of two octrees, whose elements the narrow phase tests. A job is a part of
/// the traversal. A second round repeats jobs in which some batches ran before the step was known
/// to start intersecting. This is rare: most such steps are known before, or from their first
/// batch.
class MeshWork {
 public:
  explicit MeshWork(const Search& search) : m_search(search) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const;
  void run(int round, std::size_t job, JobScratch&) const;
  void join(Jobs, const FrameJoin&) const;

  /// In place of start(), for those who ask for candidates: element pairs whose boxes overlap in
  /// the world, of one mesh without those that share a vertex.
  std::size_t startCandidates(const FrameStart& frame) {
    return m_candidates.start(question(), frame, false, BoxFrame::World);
  }
  /// Calls use(pairs) for each batch of a job's candidates.
  template <class Use>
  void forEachBatch(std::size_t job, JobScratch& scratch, Use&& use) const {
    m_candidates.forEachBatch(question(), job, scratch, use);
  }

 private:
  const Question& question() const { return *m_search.question; }
  static std::size_t jobsFor(const FrameStart&);
  std::size_t startKept(const FrameStart&);
  void runKept(std::size_t job, JobScratch&) const;
  void runByBruteForce(JobScratch&) const;
  void checkStart(const MeshPair&, std::span<const ElementPair>, JobScratch&) const;
  void detect(std::span<const ElementPair>, JobScratch&) const;
  void findEarliest(const MeshPair&, std::span<const ElementPair>, JobScratch&) const;
  void detectIntersections(std::span<const ElementPair>, JobScratch&) const;
  bool repeats(const JobScratch&) const;
  std::size_t preferBodies(const FrameJoin&, std::size_t preferred) const;

  Search m_search;
  bool m_byBruteForce = false;
  TreeCandidates m_candidates;
  std::size_t m_searchJobs = 0;  ///< further jobs make lists of KeptPairs
};

}  // namespace palpate
