#pragma once

#include <palpate/FrameStatistics.h>
#include <palpate/Settings.h>

#include "CollisionDetection/BodyContacts.h"
#include "CollisionDetection/FirstImpacts.h"
#include "CollisionDetection/Order.h"
#include "CollisionDetection/PairTable.h"
#include "Core/Threads.h"
#include "NarrowPhase/NarrowPhase.h"
#include "NarrowPhase/Piercing.h"
#include "Octree/Traversal.h"
#include "Shapes/DistinctContacts.h"

#include <memory>
#include <span>
#include <vector>

namespace palpate {

/// Takes the pairs through a frame: from octrees to candidates to contacts. Its scratch remembers
/// its peak.
class Frame {
 public:
  Frame();
  ~Frame();
  Frame& operator=(Frame&&) noexcept;

  /// Writes the candidates of each pair, unsorted, to its record.
  void collect(std::span<PairRecord* const>, const Threads&, FrameStatistics&);
  using BatchFunction = void (*)(void* context, const CollisionPair&, std::span<const ElementPair>);
  /// Passes the candidates of each pair to a function, batch by batch, one call at a time.
  void forEach(std::span<PairRecord* const>, const Threads&, BatchFunction, void* context);
  /// Writes the contacts of each pair, sorted, to PairRecord::next. With Settings::keepCandidates
  /// it also writes the candidates to the record.
  void detect(std::span<PairRecord* const>, const Settings&, const Threads&, FrameStatistics&);
  /// Writes the same results, found by testing every feature against every other.
  void detectByBruteForce(std::span<PairRecord* const>, const Settings&, FrameStatistics&);

 private:
  struct Job;
  void start(std::span<PairRecord* const>, const Threads&, bool adjacentPairs, BoxFrame);
  void startField(PairRecord&, const Threads&);
  void prepareFields(const Threads&);
  void run(Job&) const;
  void startProxy(PairRecord&, std::size_t grain);
  void describeProxy(std::span<const std::unique_ptr<Job>>, PairRecord&);
  void writeProxyContacts(std::span<const std::unique_ptr<Job>>, const Threads&, PairRecord&);
  void finish(PairRecord&, bool nearby, bool candidatesSorted, const Settings&, FrameStatistics&);
  std::size_t preferBodies(PairRecord&, Engine, std::size_t preferred);
  void findMissedIntersections(const Threads&);
  Job& newJob(PairRecord&);

  std::vector<std::unique_ptr<Job>>
      m_jobs;  ///< the first m_jobCount are in use, those of a pair together
  std::size_t m_jobCount = 0;
  bool m_usesFields = false;
  Buffer<NodePair> m_nodePairs;
  TraversalStack m_stack;
  std::vector<ContactBuffers*> m_buffers, m_intersections;  ///< of the pair that finish() handles
  ContactBuffers m_impacts;
  ContactBuffers m_pierced, m_leaving;  ///< of PiercingContacts, at the step's end and start
  PiercingContacts m_piercingContacts;
  KnownSides m_knownSides;
  std::unique_ptr<BodyContacts> m_bodies;  ///< null before a pair first needs it
  StepFacts m_facts;
  OrderScratch m_orderScratch;
  FirstImpacts m_firstImpacts;
  DistinctContacts m_distinctContacts;
  Buffer<std::uint8_t> m_flags;  ///< scratch
};

}  // namespace palpate
