#pragma once

#include <cstddef>

namespace palpate {

/// Bytes that an OctreeBasedCD holds, by what they are for. Settings::memoryLimit limits `total`.
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

/// Times and counts of one frame, over all geometries and pairs. A frame is one detectCollision()
/// with the updates before it.
struct FrameStatistics {
  /// Wall-clock milliseconds of the frame. Where threads work on two stages at once, the time is
  /// divided in proportion to their work.
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
  /// vertices that belong to no enabled element, so that no pair tests them
  std::size_t untestedVertices = 0;
  std::size_t rebuiltOctrees = 0, refittedOctrees = 0, unchangedOctrees = 0;
  /// Element pairs that the narrow phase received. Fewer than those of forEachCandidate() for two
  /// placed bodies: their boxes are compared in the frame of one body.
  std::size_t candidatePairs = 0;
  /// vertex-triangle and edge-edge pairs that the candidates own. Intersection decides each
  /// triangle pair as a whole and counts none.
  std::size_t featurePairs = 0;
  std::size_t contacts = 0;               ///< of all lists of contacts
  std::size_t intersectingTriangles = 0;  ///< entries of CollisionData::intersectingTriangles()
  /// decisions that floating point left open and exact arithmetic made
  std::size_t exactDecisions = 0;
  /// triangle pairs that were tested for Validity::startedApart only: the candidates of initial
  /// intersection checks, and the triangles around contacts
  std::size_t validityPairs = 0;
  MemoryUse memory;  ///< at the frame's end
  /// The most of each since the object was made, or since releaseMemory(). They may be of different
  /// times: their sum may exceed `total`.
  MemoryUse peakMemory;
};

/// Time and counts of one pair in the last detectCollision(). All but `contacts` are 0 for a pair
/// whose answer still holds, because nothing changed.
struct PairStatistics {
  /// Of all threads together: the search for candidates, the narrow phase and the order. Not the
  /// octrees, which pairs share.
  double milliseconds = 0;
  std::size_t candidatePairs = 0, featurePairs = 0, exactDecisions = 0;  ///< as FrameStatistics
  std::size_t contacts = 0;                                              ///< in all lists
};

}  // namespace palpate
