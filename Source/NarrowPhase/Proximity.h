#pragma once

#include <palpate/Distance.h>

#include "NarrowPhase/NarrowPhase.h"

#include <cstdint>
#include <span>

namespace palpate {

/// Method::Proximity of findContacts().
///
/// Distinct, self-collision: of two vertices nearest to each other's triangles in a corner the
/// lower one is the contact's vertex. A vertex's own triangles count for nothing: they neither hold
/// nor drop a contact.
void findProximity(const MeshPair&, std::span<const TrianglePair> candidates, ContactBuffers& out);

/// Method::Proximity of findContactsByBruteForce().
void findProximityByBruteForce(const MeshPair&, const FeatureLists&, ContactBuffers& out);

/// A feature of a mesh that holds a closest point, by the mesh's own ids.
struct MeshFeature {
  enum class Kind : std::uint8_t { Vertex, Edge, Face } kind;
  std::uint32_t id;
  friend bool operator==(const MeshFeature&, const MeshFeature&) = default;
};

inline MeshFeature featureOf(const MeshTopology& topology, std::uint32_t triangle,
                             TriangleFeature feature) {
  const int i = static_cast<int>(feature);
  if (i < 3) return {MeshFeature::Kind::Vertex, topology.triangles[triangle][i]};
  if (i < 6) return {MeshFeature::Kind::Edge, topology.triangleEdges[triangle][i - 3]};
  return {MeshFeature::Kind::Face, triangle};
}

inline MeshFeature featureOf(const MeshTopology& topology, std::uint32_t edge,
                             EdgeFeature feature) {
  if (feature == EdgeFeature::Interior) return {MeshFeature::Kind::Edge, edge};
  return {MeshFeature::Kind::Vertex, topology.edges[edge][feature == EdgeFeature::End]};
}

inline bool holdsVertex(const Triangle& triangle, std::uint32_t vertex) {
  return triangle[0] == vertex || triangle[1] == vertex || triangle[2] == vertex;
}

/// Of a segment {p, q, q} or a point {p, p, p}, some of whose corners and edges are the same, the
/// first name that the feature has; of a triangle its only name.
inline TriangleFeature firstNameOf(TriangleFeature feature, const Triangle& corners) {
  if (corners[1] != corners[2]) return feature;
  if (corners[0] == corners[1]) return TriangleFeature::CornerA;
  if (feature == TriangleFeature::EdgeCA) return TriangleFeature::EdgeAB;
  return feature <= TriangleFeature::CornerB || feature == TriangleFeature::EdgeAB
             ? feature
             : TriangleFeature::CornerB;
}

/// The contact of features that are measured at a time of the step: at its end, or at an impact.
inline VertexTriangleContact contactOf(std::uint32_t vertex, std::uint32_t triangle,
                                       const Triangle& corners,
                                       const VertexTriangleDistance& answer, double time = 1.0) {
  return {vertex,        triangle,        corners, answer.barycentric,
          answer.normal, answer.distance, time,    firstNameOf(answer.feature, corners)};
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
          answer.featureA,
          answer.featureB};
}

}  // namespace palpate
