#pragma once

#include <palpate/Types.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// Bytes that an OctreeBasedCD holds. Settings::memoryLimit limits `total`.
struct MemoryUse {
  std::size_t geometries = 0;  ///< topologies, positions, pairs
  std::size_t octrees = 0;     ///< with the floats from which their boxes come, and leaves of Proxy
  std::size_t pairs = 0;       ///< the search for candidate pairs
  std::size_t narrowPhase = 0;  ///< from candidates to unsorted contacts
  std::size_t results = 0;      ///< the results of all pairs, and what sorts them
  std::size_t queries = 0;      ///< of SpatialQueries, also those of snapshots
  std::size_t snapshots = 0;    ///< published ones that somebody holds, and memory for the next
  std::size_t total = 0;
};

/// A pair for which a detection with a budget had no time.
struct UnfinishedPair {
  GeometryId a, b;
  /// L: no features of the two are nearer now, less radii; by Continuous and Auto at no time of the
  /// step. Proven from boxes around the geometries. 0: they may touch.
  double distanceBound = 0.0;
  std::uint32_t age = 0;  ///< Validity::age of the answer that the pair keeps
  /// The detection began with the pair, and the whole time was not enough for it: while the pair
  /// moves so, no detection with this budget can finish it.
  bool exceedsBudget = false;
  friend bool operator==(const UnfinishedPair&, const UnfinishedPair&) = default;
};

/// Of one detectCollision() with the updates before it, over all geometries and pairs.
struct FrameStatistics {
  /// Wall-clock milliseconds. Stages at the same time are divided in proportion to their work.
  struct Stages {
    double boxes = 0;        ///< from positions to float boxes
    double octree = 0;       ///< keys, sort, nodes, fitted boxes
    double pairs = 0;        ///< from octrees to candidate pairs
    double narrowPhase = 0;  ///< from feature pairs to contacts
    double order = 0;        ///< sorting the results
    double update() const { return boxes + octree; }
    double total() const { return boxes + octree + pairs + narrowPhase + order; }
  } milliseconds;

  std::size_t geometries = 0;
  std::size_t triangles = 0, segments = 0, points = 0;  ///< elements of all geometries
  std::size_t untestedVertices = 0;                     ///< of no enabled element
  std::size_t rebuiltOctrees = 0, refittedOctrees = 0, unchangedOctrees = 0;
  /// For the narrow phase; of two placed bodies fewer than those of forEachCandidate(). Of an
  /// analytical shape: the elements near it, and 1 for another shape.
  std::size_t candidatePairs = 0;
  std::size_t featurePairs = 0;           ///< owned by candidates; Intersection counts none
  std::size_t contacts = 0;               ///< of all lists of contacts
  std::size_t intersectingTriangles = 0;  ///< entries of CollisionData::intersectingTriangles()
  std::size_t exactDecisions = 0;         ///< where floating point left them open
  std::size_t validityPairs = 0;          ///< tested for Validity::startedApart only
  MemoryUse memory;                       ///< at the frame's end
  MemoryUse peakMemory;                   ///< since the start or releaseMemory(), each at its time
  std::vector<UnfinishedPair> unfinishedPairs;  ///< in the order of pairs()
  /// The search for free motions had no time: OctreeBasedCD::freeMotion() follows from boxes.
  bool freeMotionUnfinished = false;
};

/// Of the last detection. All but `contacts` are 0 for a pair whose answer still holds.
struct PairStatistics {
  double milliseconds = 0;  ///< of all threads together, without octrees
  std::size_t candidatePairs = 0, featurePairs = 0, exactDecisions = 0;  ///< as FrameStatistics
  std::size_t contacts = 0;                                              ///< in all lists
};

}  // namespace palpate
