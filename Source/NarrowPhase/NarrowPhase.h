#pragma once

#include <palpate/Settings.h>

#include "Contact/Contents.h"
#include "NarrowPhase/FeaturePairs.h"
#include "NarrowPhase/IntersectionFilter.h"
#include "Shapes/ShapeContacts.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace palpate {

/// What the narrow phase must find out about a pair's step. Docs/Algorithms/Validity.md explains
/// why.
struct StepPlan {
  /// L: no two features move further relative to each other. 0: the step is not examined, only its
  /// end.
  double motion = 0.0;
  /// L: `motion` plus rounding errors. Features further apart at the step's end did not touch in
  /// the step.
  double motionWithRounding = std::numeric_limits<double>::infinity();
  /// L: the same for the candidates at hand, if they are known to move less. With rounding.
  double motionOfCandidates = std::numeric_limits<double>::infinity();
  /// L: Auto's Proximity has no false negative among feature pairs that move at most this far.
  double slowMotion = 0.0;
  /// L: touches on the arcs of bodies that turn are this much nearer than straight motion has them.
  double arcDeviation = 0.0;
  double extraThickness = 0.0;  ///< L: added to the thickness for proximity at the step's end
  /// Auto: feature pairs that may have touched in the step are reported by their impact.
  bool reportsImpacts = false;
  bool checksStart = false;  ///< whether the initial intersection check runs
  /// The elements of both meshes below these ids are known to be apart where the step starts.
  std::array<std::uint32_t, 2> apartBelow{};
};

/// One pair of meshes in one frame.
struct MeshPair {
  const TriangleMesh& a;
  const TriangleMesh& b;  ///< the same object for self-collision
  PairSettings settings;  ///< with the method chosen; Auto here: both Proximity and Continuous
  /// For discarding feature pairs by their boxes. Null: the results are the same, but take longer.
  const FloatPair* floats = nullptr;
  StepPlan step{};
  const IndexLists* nearAtRest = nullptr;  ///< per vertex: later ones within restDistance at rest
  const ContactPredicate* predicate = nullptr;
  /// For a StepGuard: Continuous reports features with radii that come nearer than findNearing()
  /// lets them.
  bool keepsApart = false;
  bool findsPassages() const { return settings.reportCrossings || settings.rememberSides; }
  bool reportsDistinct() const { return settings.contacts == Contacts::Distinct; }
  double thicknessAtEnd() const { return settings.thickness + step.extraThickness; }
  /// L: features whose distance without radii is larger than this are no contacts.
  double maxFeatureDistance() const {
    return thicknessAtEnd() + (a.largestRadius + b.largestRadius);
  }
  bool self() const { return &a == &b; }
  /// L: the radius of a vertex plus that of the other element at its closest point. swapped: the
  /// vertex is of b.
  double radii(std::uint32_t vertex, const Triangle& corners, const Eigen::Vector3d& weights,
               bool swapped) const {
    const TriangleMesh &vertices = swapped ? b : a, &others = swapped ? a : b;
    return vertices.radius(vertex) + others.radius(corners, weights);
  }
  /// L: the largest radii of two features. Surfaces are at least their distance less this apart,
  /// also where radii differ along an element.
  double largestRadii(std::uint32_t vertex, const Triangle& corners, bool swapped) const {
    const TriangleMesh &vertices = swapped ? b : a, &others = swapped ? a : b;
    return vertices.radius(vertex) + largestRadius(others, corners);
  }
  double largestRadii(const Segment& ofA, const Segment& ofB) const {
    return largestRadius(a, ofA) + largestRadius(b, ofB);
  }
  template <class Vertices>
  static double largestRadius(const TriangleMesh& mesh, const Vertices& vertices) {
    if (mesh.radii.empty()) return mesh.largestRadius;
    double most = 0.0;
    for (const std::uint32_t v : vertices) most = std::max(most, mesh.radii[v]);
    return most;
  }
  bool hasFilters() const { return nearAtRest || predicate || a.outerSideOnly || b.outerSideOnly; }
  bool has(GeometryType type) const { return a.topology.type == type || b.topology.type == type; }
  /// Self-collision excludes a vertex with the triangles around it. Of two points, the lower one is
  /// tested as the vertex.
  bool excludesVertex(std::uint32_t vertex, std::uint32_t triangle) const {
    if (!self()) return false;
    PALPATE_ASSERT(triangle < a.topology.elements.size());
    const auto& [i, j, k] = a.topology.elements[triangle];
    return vertex == i || vertex == j || vertex == k ||
           (a.topology.type == GeometryType::Points && triangle < vertex);
  }
  /// Self-collision excludes edges with a common vertex.
  bool excludesEdges(std::uint32_t edgeA, std::uint32_t edgeB) const {
    return self() && shareVertex(a.topology.edges[edgeA], a.topology.edges[edgeB]);
  }
};

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
  /// Adds what was found about a shape. atStart: with Continuous.
  void addShape(const ShapeContactBuffers&, bool atStart);
};

/// A feature of a mesh that holds a closest point, by the mesh's own ids.
struct MeshFeature {
  enum class Kind : std::uint8_t { Vertex, Edge, Face } kind;
  std::uint32_t id;
  auto operator<=>(const MeshFeature&) const = default;
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

/// What one worker found. Unsorted; cleared and filled again each frame.
struct ContactBuffers {
  ShapeContactBuffers shapes;  ///< of pairs with shapes, fields and proxies
  Buffer<VertexTriangleContact> vertexTriangle, triangleVertex;
  Buffer<EdgeEdgeContact> edgeEdge;
  Buffer<ElementPair> intersectingTriangles;
  Buffer<Crossing> passages;              ///< PairSettings::reportCrossings
  Buffer<EdgeCrossing> crossings;         ///< Intersection: of all batches
  Buffer<EdgeCrossing> crossingsAtStart;  ///< Auto, where the step begins in intersection
  Buffer<PiercedPair> pierced;            ///< the same
  FeaturePairs features;                  ///< scratch: of the present batch
  Buffer<ElementPair> part, calm, fast;   ///< scratch: some pairs of the present batch
  Buffer<PossibleIntersection> possible;  ///< scratch: of the present batch
  StepFacts facts;
  std::size_t featurePairs = 0;    ///< tested
  std::size_t exactDecisions = 0;  ///< left to exact arithmetic
  std::size_t validityPairs = 0;   ///< triangle pairs tested for Validity::startedApart
  void clear();
};

/// Appends the contacts of the candidate triangle pairs. Each contact is appended once over all
/// batches of a frame. Only Method::Intersection may repeat contacts; orderContacts() removes the
/// copies. Self-collision: pass each unordered triangle pair once. Adjacent pairs and (t, t) may be
/// among them: pairs that own no feature pair cost little.
/// Threads  safe for different output buffers.
void findContacts(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

}  // namespace palpate
