#pragma once

#include <cstddef>

namespace palpate {

/// What the last frame cost and met, stage by stage.
struct FrameStatistics {
  /// Wall-clock milliseconds of the last frame.
  struct Stages {
    double boxes = 0;        ///< positions to float boxes
    double octree = 0;       ///< keys, sort, nodes, fitted boxes
    double pairs = 0;        ///< traversal to candidate pairs
    double narrowPhase = 0;  ///< feature pairs to contacts
    double order = 0;        ///< sorting the results
    double update() const { return boxes + octree; }
    double total() const { return boxes + octree + pairs + narrowPhase + order; }
  } milliseconds;

  std::size_t geometries = 0;
  std::size_t triangles = 0, segments = 0, points = 0;
  std::size_t untestedVertices = 0;  ///< vertices in no triangle or segment: counted, not tested
  std::size_t rebuiltOctrees = 0, refittedOctrees = 0, unchangedOctrees = 0;
  std::size_t candidatePairs = 0;  ///< element pairs handed to the narrow phase
  /// vertex-triangle and edge-edge pairs that those own; none for Intersection, which decides each
  /// triangle pair as a whole
  std::size_t featurePairs = 0;
  std::size_t contacts = 0;  ///< vertex-triangle, triangle-vertex and edge-edge
  std::size_t intersectingTriangles = 0;
  /// left undecided by floating point, decided by exact arithmetic
  std::size_t exactDecisions = 0;
  /// candidates, and triangle pairs at contacts, looked at once more for Validity::startedApart
  std::size_t validityPairs = 0;
};

}  // namespace palpate
