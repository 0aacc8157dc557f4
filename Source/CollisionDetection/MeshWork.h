#pragma once

#include "CollisionDetection/JobScratch.h"
#include "CollisionDetection/PairResults.h"
#include "CollisionDetection/PairTable.h"
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
  explicit MeshWork(PairRecord& record) : m_record(&record) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const;
  void run(int round, std::size_t job, JobScratch&) const;
  void runByBruteForce(JobScratch&) const;
  void join(Jobs, const FrameJoin&) const;

  /// The same as start(), for those who ask for candidates: element pairs whose boxes overlap in
  /// the world, of one mesh without those that share a vertex.
  std::size_t startCandidates(const FrameStart&);
  /// Whether candidatesAmong() may leave some out.
  bool isFiltered() const;
  /// Calls use(pairs) for each batch of a job's candidates.
  template <class Use>
  void forEachBatch(std::size_t job, JobScratch& scratch, Use&& use) const {
    struct Context {
      const MeshWork& work;
      JobScratch& scratch;
      Use& use;
    } context{*this, scratch, use};
    scratch.sink.start(
        [](void* opaque, std::span<const ElementPair> pairs) {
          Context& c = *static_cast<Context*>(opaque);
          const std::span<const ElementPair> candidates = c.work.candidatesAmong(pairs, c.scratch);
          if (!candidates.empty()) c.use(candidates);
        },
        &context);
    traverseJob(job, scratch);
  }
  /// Passes the traversal of a job to its sink, which was started.
  void traverseJob(std::size_t job, JobScratch&) const;

 private:
  std::size_t startTraversal(const FrameStart&, bool adjacentPairs, BoxFrame);
  std::span<const ElementPair> candidatesAmong(std::span<const ElementPair> pairs,
                                               JobScratch&) const;
  bool hasWiderBoxes() const;
  void keepInWorld(double distance, JobScratch&) const;
  std::size_t startKept(const FrameStart&);
  std::size_t startGathering(const FrameStart&);
  void runKept(std::size_t job, JobScratch&) const;
  void checkStart(const MeshPair&, std::span<const ElementPair>, JobScratch&) const;
  void detect(std::span<const ElementPair>, JobScratch&) const;
  void findEarliest(const MeshPair&, std::span<const ElementPair>, JobScratch&) const;
  void detectIntersections(std::span<const ElementPair>, JobScratch&) const;
  bool repeats(const JobScratch&) const;
  std::size_t preferBodies(const FrameJoin&, std::size_t preferred) const;

  PairRecord* m_record;
  TreePair m_trees{};
  FloatPair m_floats{};
  double m_thickness = 0;  ///< L: of the boxes that the pair's method compares
  const Buffer<NodePair>* m_nodePairs = nullptr;
  std::size_t m_first = 0, m_count = 0, m_grain = 1;  ///< of m_nodePairs
  std::size_t m_searchJobs = 0;                       ///< further jobs make lists of KeptPairs
};

}  // namespace palpate
