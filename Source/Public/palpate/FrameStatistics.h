#pragma once

#include <cstddef>

namespace palpate {

/// Times and counts of one frame, over all geometries and pairs. A frame is one detectCollision()
/// or collectCandidates() with the updates before it.
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
  /// Element pairs that the narrow phase received. Fewer for two placed bodies whose candidates are
  /// not kept: their boxes are compared in the frame of one body.
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
};

}  // namespace palpate
