#pragma once

#include "Search/JobScratch.h"
#include "Search/Question.h"
#include "Search/TraversalJobs.h"
#include "NarrowPhase/FeaturePairs.h"
#include "Bodies/OctreeFrame.h"
#include "Octree/Traversal.h"

#include <cstddef>
#include <span>

namespace palpate {

/// The candidates of a question about two meshes: element pairs whose boxes overlap at the distance
/// that the pair's method looks at. A traversal of both octrees finds them, and pairs that only its
/// wider or turned boxes let through are left out.
class TreeCandidates {
 public:
  /// Divides the traversal into jobs. Returns their number. adjacentPairs: with pairs of one mesh
  /// that share a vertex.
  std::size_t start(const Question&, const FrameStart&, bool adjacentPairs, BoxFrame);
  /// Calls use(pairs) for each batch of a job's candidates.
  template <class Use>
  void forEachBatch(const Question& question, std::size_t job, JobScratch& scratch,
                    Use&& use) const {
    m_traversal.forEachBatch(job, scratch, [&](std::span<const ElementPair> pairs) {
      const std::span<const ElementPair> candidates = candidatesAmong(question, pairs, scratch);
      if (!candidates.empty()) use(candidates);
    });
  }
  bool isMapped() const { return m_traversal.trees().isMapped(); }
  const FloatPair& floats() const { return m_floats; }

 private:
  std::span<const ElementPair> candidatesAmong(const Question&, std::span<const ElementPair> pairs,
                                               JobScratch&) const;

  TraversalJobs m_traversal;
  FloatPair m_floats{};
  double m_thickness = 0;  ///< L: of the boxes that the pair's method compares
};

}  // namespace palpate
