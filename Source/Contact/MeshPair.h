#pragma once

#include <palpate/Settings.h>

#include "Mesh/TriangleMesh.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace palpate {

struct FloatPair;

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
  const TriangleMesh& meshOf(std::size_t side) const { return side == 0 ? a : b; }
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

}  // namespace palpate
