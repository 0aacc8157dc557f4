#pragma once

#include <palpate/FeaturePairs.h>

#include "NarrowPhase/NarrowPhase.h"

#include <cstdint>
#include <span>

namespace palpate {

/// Implements Method::Proximity of findContacts().
///
/// Self-collision with Contacts::Distinct: if the closest points are two vertices, the contact
/// names the lower one as its vertex. The triangles around a vertex neither report nor suppress
/// contacts of that vertex.
void findProximity(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

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
