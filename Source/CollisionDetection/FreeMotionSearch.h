#pragma once

#include <palpate/Settings.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairTable.h"
#include "NarrowPhase/FreeMotion.h"
#include "Shapes/Shape.h"
#include "Octree/Traversal.h"
#include "Core/Buffer.h"
#include "Core/MemoryBudget.h"
#include "Core/Threads.h"

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace palpate {

/// Finds the free motions of all geometries (PairSettings::freeMotionReach), beside the work on
/// contacts: in a search of its own, whose distance includes the reach. Its scratch remembers its
/// peak.
class FreeMotionSearch {
 public:
  /// Writes Geometry::nextFreeMotion, unless nothing changed since the last commit(). The octrees
  /// must be up to date. Returns whether the search ended in time. If it did not, free motions
  /// follow from PairRecord::distanceBound, also those of geometries with an unfinished pair.
  bool find(const GeometryTable&, const PairTable&, Engine, const Threads&);
  /// Makes what find() wrote the result.
  void commit(const GeometryTable&) noexcept;
  /// A pair, and its state for which the results hold.
  struct Known {
    CollisionPair pair;
    PairRecord::State state;
  };
  std::vector<Known>& known() { return m_known; }
  const std::vector<Known>& known() const { return m_known; }

 private:
  /// A pair, and the part of m_nodePairs that belongs to it.
  struct Work {
    const PairRecord* record;
    double searchDistance;
    TreePair trees{};
    std::size_t first = 0, count = 0, grain = 1;
  };
  struct Place {
    std::size_t work, job;
  };
  struct Scratch : CountedObject {
    TraversalStack stack;
    PairSink sink;
    Buffer<ElementPair> candidates;
    Buffer<std::uint32_t> elements;
    ShapePairScratch shapes;
  };

  bool isKnown(const PairTable&) const;
  void search(Engine, const Threads&);
  void start(const GeometryTable&, const PairTable&);
  void startSearch(Work&, bool divides);
  void run(const Work&, std::size_t job, Scratch&) const;
  static void runByBruteForce(const Work&, Scratch&);
  static void withShape(const Work&, Engine, Scratch&);

  std::vector<Known> m_known;
  bool m_isNew = false;  ///< commit() has something to commit
  std::vector<Work> m_works;
  std::vector<Geometry*> m_boxed;  ///< each once
  std::vector<Place> m_places;
  std::vector<std::unique_ptr<Scratch>> m_scratch;
  Buffer<NodePair> m_nodePairs;
  TraversalStack m_stack;
};

}  // namespace palpate
