#pragma once

#include "Search/JobScratch.h"
#include "Search/Question.h"
#include "Search/TraversalJobs.h"
#include "NarrowPhase/FreeMotion.h"

#include <cstddef>

namespace palpate {

/// Lowers the free motions of a pair's vertices, or of its shapes, by the features that are near
/// them (PairSettings::freeMotionReach).
class FreeMotionWork {
 public:
  /// motions: of all vertices of each body, or one number for a shape. They are written by run().
  FreeMotionWork(const Question& question, const FreeMotions& motions);

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const { return round == 0; }
  void run(int round, std::size_t job, JobScratch&) const;
  void join(Jobs, const FrameJoin&) const {}

 private:
  void runByBruteForce(const MeshPair&, JobScratch&) const;
  void withShape(JobScratch&) const;

  const Question* m_question;
  FreeMotions m_motions;
  FreeMotionRange m_range;
  double m_searchDistance;  ///< L
  bool m_byBruteForce = false;
  TraversalJobs m_traversal;
};

}  // namespace palpate
