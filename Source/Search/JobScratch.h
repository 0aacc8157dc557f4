#pragma once

#include <palpate/FrameStatistics.h>
#include <palpate/Settings.h>

#include "DistanceField/PlacedProxy.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Octree/Traversal.h"
#include "Core/Buffer.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopping.h"
#include "Core/Threads.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace palpate {

/// What a job of a pair's work found, and its scratch, which remembers its peak.
struct JobScratch : CountedObject {
  ContactBuffers contacts;
  ContactBuffers intersections;      ///< Auto: Intersection's, where the step starts intersecting
  bool nearby = false;               ///< some boxes overlap at the thickness of the traversal
  bool intersectionsMissed = false;  ///< they were not looked for in every batch
  std::size_t candidateCount = 0;
  ProxyHits hits;
  double milliseconds = 0, narrowMilliseconds = 0;

  TraversalStack stack;
  PairSink sink;
  Buffer<std::uint32_t> elements;
  Buffer<ElementPair> kept;     ///< pairs of the present batch that passed the filters so far
  Buffer<ElementPair> unknown;  ///< those that the initial intersection check must test
  // Of KeptPairs:
  Buffer<ElementPair> near;
  Buffer<float> bounds;
  Buffer<std::uint8_t> classes;

  void clear() {
    contacts.clear();
    intersections.clear();
    nearby = intersectionsMissed = false;
    candidateCount = 0;
    hits.count = 0;
    milliseconds = narrowMilliseconds = 0;
  }
};

/// The jobs of one pair.
using Jobs = std::span<const std::unique_ptr<JobScratch>>;

/// What start() of a pair's work needs of the frame.
struct FrameStart {
  const Threads& threads;
  Engine engine;
  Buffer<NodePair>& nodePairs;  ///< of the traversals of all pairs
  TraversalStack& stack;
  /// Whether a pair has many jobs if it is large enough. Results do not depend on it.
  bool divides() const { return threads.count() > 1 || isTimed(); }
};

/// The same of join().
struct FrameJoin {
  const Threads& threads;
  Engine engine;
  FrameStatistics& statistics;
  class PairResults& results;
};

}  // namespace palpate
