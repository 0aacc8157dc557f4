#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Settings.h>

#include "Core/Buffer.h"
#include "Mesh/TriangleMesh.h"
#include "NarrowPhase/FeaturePairs.h"
#include "NarrowPhase/IntersectionFilter.h"
#include "Shapes/ShapeContacts.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace palpate {

/// What a pair's step asks of the narrow phase; Docs/Algorithms/Validity.md has the reasons.
struct StepPlan {
  /// L: no two features move further, relative to each other. 0: nothing is asked of the step.
  double motion = 0.0;
  /// L: motion, and what rounding adds to it; features further apart at the end did not touch.
  double certain = std::numeric_limits<double>::infinity();
  double slow = 0.0;   ///< L: Auto's Proximity misses no feature pair that moves at most this far
  double extra = 0.0;  ///< L: added to the thickness for proximity at the step's end
  /// Auto: feature pairs that the step may have brought together are answered by their impact.
  bool impacts = false;
  bool start = false;  ///< whether triangles intersect at the step's start is asked
};

/// One pair of meshes in one frame.
struct MeshPair {
  const TriangleMesh& a;
  const TriangleMesh& b;  ///< the same object for self-collision
  PairSettings settings;  ///< method resolved; Auto: Proximity and Continuous
  /// For throwing out feature pairs by their boxes; without, the same answer takes longer.
  const FloatPair* floats = nullptr;
  StepPlan step{};
  const IndexLists* near = nullptr;  ///< restDistance: vertices too near each other at rest
  const ContactPredicate* predicate = nullptr;
  /// Of a geometry that is a shape, whose mesh has no elements; null: it is none.
  const PlacedShape *shapeOfA = nullptr, *shapeOfB = nullptr;
  double thicknessAtEnd() const { return settings.thickness + step.extra; }
  /// L: centres further apart are no contacts.
  double reach() const { return thicknessAtEnd() + (a.largestRadius + b.largestRadius); }
  bool self() const { return &a == &b; }
  /// L: a vertex's and that of what it is tested against, where it is closest.
  double radii(std::uint32_t vertex, const Triangle& corners, const Eigen::Vector3d& barycentric,
               bool ofSecond) const {
    const TriangleMesh &vertices = ofSecond ? b : a, &others = ofSecond ? a : b;
    return vertices.radius(vertex) + others.radius(corners, barycentric);
  }
  bool filters() const { return near || predicate || a.outer || b.outer; }
  bool hasShape() const { return shapeOfA || shapeOfB; }
  bool isOfShapes() const { return shapeOfA && shapeOfB; }
  /// Of a pair with a shape: the other one, and the shape.
  const TriangleMesh& mesh() const { return shapeOfA ? b : a; }
  const PlacedShape& shape() const { return *(shapeOfA ? shapeOfA : shapeOfB); }
  bool hasLines() const {
    return a.topology.kind == GeometryKind::Lines || b.topology.kind == GeometryKind::Lines;
  }
  /// Self-collision: a vertex with a triangle at it; of two points the lower is the vertex.
  bool leavesOutVertex(std::uint32_t vertex, std::uint32_t triangle) const {
    if (!self()) return false;
    const auto& [i, j, k] = a.topology.triangles[triangle];
    return vertex == i || vertex == j || vertex == k ||
           (a.topology.kind == GeometryKind::Points && triangle < vertex);
  }
  /// Self-collision: edges with a common vertex.
  bool leavesOut(std::uint32_t edgeA, std::uint32_t edgeB) const {
    return self() && shareVertex(a.topology.edges[edgeA], a.topology.edges[edgeB]);
  }
};

/// What was seen of a method's conditions. Ids may repeat.
struct StepFacts {
  /// L: no pair of features that is a contact is nearer at the step's end; 0: it may have touched.
  double clearance = std::numeric_limits<double>::infinity();
  bool startsIntersecting = false;
  Buffer<std::uint32_t> verticesA, verticesB;      ///< of features that may have touched
  Buffer<std::uint32_t> degenerateA, degenerateB;  ///< triangles without area in contacts
  void clear();
  void add(const StepFacts&);
};

/// What one worker found. Unsorted; cleared and filled again each frame.
struct ContactBuffers : ShapeContactBuffers {
  Buffer<VertexTriangleContact> vertexTriangle, triangleVertex;
  Buffer<EdgeEdgeContact> edgeEdge;
  Buffer<ElementPair> intersectingTriangles;
  FeaturePairs features;                  ///< scratch: of the batch at hand
  Buffer<ElementPair> part;               ///< scratch: some of the batch at hand
  Buffer<PossibleIntersection> possible;  ///< scratch: of the batch at hand
  StepFacts facts;
  std::size_t validityPairs = 0;  ///< looked at for startedApart
  void clear();
};

/// f(list) of contacts that have a time of impact.
template <class Lists, class F>
void forEachTimed(Lists& lists, F&& f) {
  f(lists.vertexTriangle), f(lists.triangleVertex), f(lists.edgeEdge), f(lists.shape);
  f(lists.shapeShape);
}

/// Appends the contacts of the candidate triangle pairs. Each contact that the pair's method
/// includes comes out once over all batches of a frame, except Intersection's, which may repeat and
/// are made unique by whoever orders them. Self-collision: every unordered triangle pair once,
/// adjacent ones and (t, t) excluded or not as the caller likes: pairs in which nothing is owned
/// cost little.
/// Threads  safe for different output buffers.
void findContacts(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

}  // namespace palpate
