#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Tracking.h>

#include "Contact/MeshFeature.h"
#include "Contact/MeshPair.h"
#include "Shapes/ShapeContacts.h"
#include "Math/TriangleIntersection.h"
#include "Core/Buffer.h"

#include <compare>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace palpate {

/// How two surfaces meet. Bodies whose surfaces touch rest on each other; those that pierce overlap
/// (NarrowPhase/Meeting.h).
enum class Meeting : std::uint8_t { Apart, Touching, Piercing };

/// What the narrow phase found out about the conditions of a pair's method. Ids may repeat.
struct StepFacts {
  /// L: at the step's end, no feature pair that is a contact, filtered or not, is nearer than this.
  /// 0: a feature pair may have touched in the step. Proximity subtracts radii.
  double clearance = std::numeric_limits<double>::infinity();
  /// L, Continuous: at the step's start, no feature pair is nearer than this, less radii and
  /// rounding errors. Infinity: none was within the thickness.
  double gapAtStart = std::numeric_limits<double>::infinity();
  bool sideUnknown = false;  ///< features touched, and the step does not tell from which side
  Meeting atStart = Meeting::Apart;  ///< how the surfaces meet at the step's start, where checked
  bool startsPiercing() const { return atStart == Meeting::Piercing; }
  Buffer<std::uint32_t> verticesA, verticesB;      ///< of features that may have touched
  Buffer<std::uint32_t> degenerateA, degenerateB;  ///< triangles without area in contacts
  void clear();
  void add(const StepFacts&);
  /// Records the triangle of a contact if it has no area, or a triangle at an edge that has none.
  void recordTriangle(const MeshPair&, std::uint32_t triangle, bool isOfB, const Eigen::Vector3d& a,
                      const Eigen::Vector3d& b, const Eigen::Vector3d& c);
  void recordEdges(const MeshPair&, const Segment& p, const Segment& q);
  /// Adds what was found about a shape. atStart: with Continuous.
  void addShape(const ShapeContactBuffers&, bool atStart);
};

/// Two features by their indices: a vertex and a triangle, or two edges of MeshTopology::edges.
struct FeaturePair {
  std::uint32_t a, b;
};

/// Feature pairs of one batch of triangle pairs. Each batch overwrites those of the last.
struct FeaturePairs {
  Buffer<FeaturePair> vertexTriangle;  ///< vertices of the first mesh, triangles of the second
  Buffer<FeaturePair>
      triangleVertex;  ///< triangles of the first, vertices of the second; none for self-collision
  Buffer<FeaturePair> edgeEdge;  ///< self-collision: lower edge first
  std::size_t owned = 0;         ///< number of pairs before their boxes were compared
};

/// Two triangles that are not proven to be apart.
struct PossibleIntersection {
  ElementPair triangles;
  TriangleIntersection intersection;  ///< if known: which edges cross; no features touch
  bool isKnown() const { return intersection.intersect(); }
};

/// An edge that crosses a triangle of the other mesh: see PiercingContacts.
struct EdgeCrossing {
  bool ofB;  ///< the edge is of MeshPair::b, the triangle of MeshPair::a
  std::uint32_t edge;
  MeshFeature through;  ///< the feature of the triangle that the edge passes through
  std::uint32_t triangle;
  bool lowerIsBehind;  ///< whether the edge's first vertex is behind the triangle, or the second
  auto operator<=>(const EdgeCrossing&) const = default;
};

/// Two triangles that pierce each other without touching. Bit i: edge i crosses the other triangle.
struct PiercedPair {
  ElementPair triangles;
  std::uint8_t edgesOfA, edgesOfB;
};

/// A vertex behind a surface, and the direction in which it leaves it.
struct LeavingVertex {
  bool ofB;  ///< the vertex is of MeshPair::b
  std::uint32_t vertex, triangle;
  Eigen::Vector3d outward;
};

/// What one worker found. Unsorted; cleared and filled again each frame.
struct ContactBuffers {
  ShapeContactBuffers shapes;  ///< of pairs with shapes, fields and proxies
  Buffer<VertexTriangleContact> vertexTriangle, triangleVertex;
  Buffer<EdgeEdgeContact> edgeEdge;
  Buffer<ElementPair> intersectingTriangles;
  Buffer<Crossing> passages;              ///< PairSettings::reportCrossings
  Buffer<EdgeCrossing> crossings;         ///< Intersection: of all batches
  Buffer<EdgeCrossing> crossingsAtStart;  ///< Auto, where the step begins in intersection
  Buffer<PiercedPair> pierced;            ///< Intersection: triangles that pierce each other
  Buffer<LeavingVertex> beyondBorder;     ///< Intersection: instead of contacts of the vertices
  FeaturePairs features;                  ///< scratch: of the present batch
  Buffer<ElementPair> part, calm, fast;   ///< scratch: some pairs of the present batch
  Buffer<PossibleIntersection> possible;  ///< scratch: of the present batch
  StepFacts facts;
  std::size_t featurePairs = 0;    ///< tested
  std::size_t exactDecisions = 0;  ///< left to exact arithmetic
  std::size_t validityPairs = 0;   ///< triangle pairs tested for Validity::startedApart
  /// The list of a vertex of MeshPair::a with a triangle, or of one of b. All contacts of a mesh
  /// with itself are in one list.
  Buffer<VertexTriangleContact>& ofVertex(const MeshPair& pair, bool ofB) {
    return ofB && !pair.self() ? triangleVertex : vertexTriangle;
  }
  void clear();
};

}  // namespace palpate
