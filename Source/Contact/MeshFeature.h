#pragma once

#include <palpate/CollisionData.h>
#include <palpate/FeaturePairs.h>

#include "Contact/ContactLists.h"
#include "Mesh/TriangleMesh.h"
#include "Math/ImpactQuery.h"

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

namespace palpate {

/// A feature of a mesh that holds a closest point, by the mesh's own ids.
struct MeshFeature {
  enum class Kind : std::uint8_t { Vertex, Edge, Face } kind;
  std::uint32_t id;
  auto operator<=>(const MeshFeature&) const = default;
};

/// The two meshes of feature pairs of one kind: vertices of `first` with triangles of `second`, or
/// edges of `first` with edges of `second`. firstId, secondId: the features' ids in these meshes.
template <ImpactQuery::Kind kind>
struct Features {
  const TriangleMesh& first;
  const TriangleMesh& second;

  std::array<std::uint32_t, 4> vertices(std::uint32_t firstId, std::uint32_t secondId) const {
    if constexpr (kind == ImpactQuery::Kind::VertexTriangle) {
      const auto& [a, b, c] = second.topology.elements[secondId];
      return {firstId, a, b, c};
    } else {
      const Segment &p = first.topology.edges[firstId], &q = second.topology.edges[secondId];
      return {p[0], p[1], q[0], q[1]};
    }
  }
  const TriangleMesh& meshOf(int vertex) const {
    return vertex < (kind == ImpactQuery::Kind::VertexTriangle ? 1 : 2) ? first : second;
  }
  ImpactQuery query(std::uint32_t firstId, std::uint32_t secondId) const {
    return query(vertices(firstId, secondId));
  }
  ImpactQuery query(const std::array<std::uint32_t, 4>& ids) const {
    ImpactQuery result{kind, {}};
    for (int i = 0; i < 4; ++i)
      result.vertices[i] = {meshOf(i).before[ids[i]], meshOf(i).now[ids[i]]};
    return result;
  }
};

/// The step of a contact's vertices. first: the mesh of the vertex, or of edge a.
template <class Contact>
ImpactQuery queryOf(const TriangleMesh& first, const TriangleMesh& second, const Contact& contact) {
  constexpr auto kKind = std::is_same_v<Contact, EdgeEdgeContact>
                             ? ImpactQuery::Kind::EdgeEdge
                             : ImpactQuery::Kind::VertexTriangle;
  return Features<kKind>{first, second}.query(verticesOf(contact));
}

inline MeshFeature featureOf(const MeshTopology& topology, std::uint32_t triangle,
                             TriangleFeature feature) {
  const int i = static_cast<int>(feature);
  if (i < 3) return {MeshFeature::Kind::Vertex, topology.elements[triangle][i]};
  if (i < 6) return {MeshFeature::Kind::Edge, topology.triangleEdges[triangle][i - 3]};
  return {MeshFeature::Kind::Face, triangle};
}

inline MeshFeature featureOf(const MeshTopology& topology, std::uint32_t edge,
                             EdgeFeature feature) {
  if (feature == EdgeFeature::Interior) return {MeshFeature::Kind::Edge, edge};
  return {MeshFeature::Kind::Vertex, topology.edges[edge][feature == EdgeFeature::End]};
}

/// The triangles that hold a vertex or an edge. None of a face.
inline std::span<const std::uint32_t> holdersOf(const MeshTopology& topology,
                                                const MeshFeature& feature) {
  if (feature.kind == MeshFeature::Kind::Vertex) return topology.vertexTriangles[feature.id];
  if (feature.kind == MeshFeature::Kind::Edge) return topology.edgeTriangles[feature.id];
  return {};
}

/// The features at one place that triangles without area join, and the triangles with area around
/// them. A triangle without area is on a line: the place is on several of its edges and corners.
struct JoinedFeatures {
  struct Face {
    std::uint32_t triangle;
    MeshFeature touched;
  };
  std::vector<MeshFeature> features;
  std::vector<Face> faces;

  /// first: a vertex or an edge; a border without an id joins nothing. isFlat(triangle): it has no
  /// area. place(u, v): of the place on the edge from u to v: 0 at u, 1 at v, 2 between, or none.
  template <class IsFlat, class Place>
  JoinedFeatures(const MeshTopology& topology, const MeshFeature& first, IsFlat&& isFlat,
                 Place&& place) {
    const auto add = [&](const MeshFeature& feature) {
      if (feature.id != kNoEdge && !has(feature)) features.push_back(feature);
    };
    std::vector<std::uint32_t> visited;
    add(first);
    for (std::size_t i = 0; i < features.size(); ++i)
      for (const std::uint32_t t : holdersOf(topology, features[i])) {
        if (std::find(visited.begin(), visited.end(), t) != visited.end()) continue;
        visited.push_back(t);
        if (!isFlat(t)) {
          faces.push_back({t, features[i]});
          continue;
        }
        for (std::size_t k = 0; k < 3; ++k) {
          const std::array ends{topology.elements[t][k], topology.elements[t][(k + 1) % 3]};
          const std::optional<int> at = place(ends[0], ends[1]);
          if (at == 2)
            add({MeshFeature::Kind::Edge, topology.triangleEdges[t][k]});
          else if (at)
            add({MeshFeature::Kind::Vertex, ends[static_cast<std::size_t>(*at)]});
        }
      }
  }
  bool has(const MeshFeature& feature) const {
    return std::find(features.begin(), features.end(), feature) != features.end();
  }
  /// A vertex among the features; null if there are edges only.
  const MeshFeature* vertex() const {
    for (const MeshFeature& each : features)
      if (each.kind == MeshFeature::Kind::Vertex) return &each;
    return nullptr;
  }
};

inline bool containsVertex(const Triangle& triangle, std::uint32_t vertex) {
  return triangle[0] == vertex || triangle[1] == vertex || triangle[2] == vertex;
}

/// The feature that the corners with weights other than 0 span. In a segment {p, q, q} or a point
/// {p, p, p} a feature has several names; returns the first.
inline TriangleFeature spannedFeature(const Triangle& corners, const Eigen::Vector3d& weights) {
  bool a = weights[0] != 0.0, b = weights[1] != 0.0, c = weights[2] != 0.0;
  if (corners[1] == corners[2]) b = b || c, c = false;
  if (corners[0] == corners[1]) a = a || b, b = false;
  if (a && b && c) return TriangleFeature::Face;
  if (a && b) return TriangleFeature::EdgeAB;
  if (b && c) return TriangleFeature::EdgeBC;
  if (a && c) return TriangleFeature::EdgeCA;
  return a ? TriangleFeature::CornerA : b ? TriangleFeature::CornerB : TriangleFeature::CornerC;
}

inline EdgeFeature spannedFeature(double weight) {
  if (weight == 0.0) return EdgeFeature::Start;
  return weight == 1.0 ? EdgeFeature::End : EdgeFeature::Interior;
}

/// The contact of two features whose distance was measured at `time`: the step's end or an impact.
inline VertexTriangleContact contactOf(std::uint32_t vertex, std::uint32_t triangle,
                                       const Triangle& corners,
                                       const VertexTriangleDistance& answer, double time = 1.0) {
  return {vertex,        triangle,        corners, answer.weights,
          answer.normal, answer.distance, time,    spannedFeature(corners, answer.weights)};
}

inline EdgeEdgeContact contactOf(const Segment& a, const Segment& b, const EdgeEdgeDistance& answer,
                                 double time = 1.0) {
  return {a,
          b,
          answer.weightA,
          answer.weightB,
          answer.normal,
          answer.distance,
          time,
          spannedFeature(answer.weightA),
          spannedFeature(answer.weightB)};
}

}  // namespace palpate
