#pragma once

#include <palpate/FrameStatistics.h>
#include <palpate/Settings.h>

#include "CollisionDetection/FirstImpacts.h"
#include "CollisionDetection/Order.h"
#include "CollisionDetection/PairTable.h"
#include "Core/Threads.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Octree/Traversal.h"

#include <memory>
#include <span>
#include <vector>

namespace palpate {

/// The pairs' way through a frame: octrees to candidates to contacts. Its scratch remembers its
/// peak.
class Frame {
 public:
  Frame();
  ~Frame();

  /// Candidates of each pair, unsorted, into its record.
  void collect(std::span<PairRecord* const>, const Threads&, FrameStatistics&);
  using BatchFunction = void (*)(void* context, const CollisionPair&, std::span<const ElementPair>);
  /// Candidates of each pair to a function, batch by batch, never two at once.
  void forEach(std::span<PairRecord* const>, const Threads&, BatchFunction, void* context);
  /// Contacts of each pair, sorted, into PairRecord::next; its candidates too if they are to be
  /// kept.
  void detect(std::span<PairRecord* const>, const Settings&, const Threads&, FrameStatistics&);
  /// The same answers from every feature against every other.
  void detectByBruteForce(std::span<PairRecord* const>, const Settings&, FrameStatistics&);

 private:
  struct Job;
  void start(std::span<PairRecord* const>, const Threads&, bool adjacentPairs);
  void run(Job&) const;
  void finish(PairRecord&, bool nearby, bool candidatesSorted, const Settings&, FrameStatistics&);
  void findMissedOverlaps(const Threads&);
  Job& newJob(PairRecord&);

  std::vector<std::unique_ptr<Job>>
      m_jobs;  ///< the first m_jobCount are in use, those of a pair together
  std::size_t m_jobCount = 0;
  Buffer<NodePair> m_nodePairs;
  TraversalStack m_stack;
  std::vector<ContactBuffers*> m_buffers, m_overlaps;  ///< of the pair at hand
  ContactBuffers m_impacts;
  StepFacts m_facts;
  OrderScratch m_orderScratch;
  FirstImpacts m_firstImpacts;
};

}  // namespace palpate
