#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Settings.h>

#include "Core/Buffer.h"
#include "Geometry/TriangleMesh.h"
#include "NarrowPhase/FeaturePairs.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// One pair of meshes in one frame.
struct MeshPair {
  const TriangleMesh& a;
  const TriangleMesh& b;  ///< the same object for self-collision
  PairSettings settings;  ///< method resolved: not Auto
  /// For throwing out feature pairs by their boxes; without, the same answer takes longer.
  const FloatPair* floats = nullptr;
  bool self() const { return &a == &b; }
};

/// What one worker found. Unsorted; cleared and filled again each frame.
struct ContactBuffers {
  Buffer<VertexTriangleContact> vertexTriangle, triangleVertex;
  Buffer<EdgeEdgeContact> edgeEdge;
  Buffer<TrianglePair> intersectingTriangles;
  FeaturePairs features;           ///< scratch: of the batch at hand
  std::size_t featurePairs = 0;    ///< tested
  std::size_t exactDecisions = 0;  ///< left to exact arithmetic
  void clear();
};

/// Appends the contacts of the candidate triangle pairs. Each contact that the pair's method
/// includes comes out once over all batches of a frame, except Intersection's, which may repeat and
/// are made unique by whoever orders them. Self-collision: every unordered triangle pair once,
/// adjacent ones and (t, t) excluded or not as the caller likes: pairs in which nothing is owned
/// cost little.
/// Threads  safe for different output buffers.
void findContacts(const MeshPair&, std::span<const TrianglePair> candidates, ContactBuffers& out);

/// Features for brute force to test against all of the other mesh: for Intersection triangles, else
/// vertices and edges.
struct FeatureLists {
  std::vector<std::uint32_t> verticesOfA, verticesOfB;
  std::vector<std::uint32_t> edgesOfA,
      trianglesOfA;  ///< self-collision: against those of higher id
};

/// All that the pair's method tests; vertices in no triangle are left out.
FeatureLists everyFeature(const MeshPair&);

/// The oracle: vertices against every triangle and edges against every edge, with no candidates and
/// no ownership. With every feature the same contacts as findContacts over complete candidates.
void findContactsByBruteForce(const MeshPair&, const FeatureLists&, ContactBuffers& out);
inline void findContactsByBruteForce(const MeshPair& pair, ContactBuffers& out) {
  findContactsByBruteForce(pair, everyFeature(pair), out);
}

}  // namespace palpate
