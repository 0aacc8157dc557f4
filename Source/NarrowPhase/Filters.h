#pragma once

#include "NarrowPhase/NarrowPhase.h"
#include "NarrowPhase/Proximity.h"

#include <cstdint>

namespace palpate {

// What the user filters out. Facts about the step are noted of all features, filtered or not, so
// that what validity says of sides and touches does not depend on filters.

/// Whether any vertex of one feature is too near to one of the other, along the mesh at rest.
template <class Vertices, class Others>
bool areNearAtRest(const MeshPair& pair, const Vertices& vertices, const Others& others) {
  if (!pair.near) return false;
  for (const std::uint32_t v : vertices)
    for (const std::uint32_t w : others) {
      const auto after = (*pair.near)[std::min(v, w)];
      if (v == w || std::binary_search(after.begin(), after.end(), std::max(v, w))) return true;
    }
  return false;
}

/// Whether a vertex and a triangle may not be a contact. ofSecond: the vertex is of the second
/// mesh.
bool refusesVertex(const MeshPair&, std::uint32_t vertex, std::uint32_t triangle, bool ofSecond);
bool refusesEdges(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB);

/// Whether a contact points inward of a mesh that is touched from outside only. The features hold
/// the closest points; direction: from the pair's second mesh to the first, not zero; time: of the
/// step, of positions and direction.
bool pointsInward(const MeshPair&, const std::array<MeshFeature, 2>& features,
                  const Eigen::Vector3d& direction, double time);

/// The same at the step's end, of features as far apart as they were measured: what touches points
/// nowhere.
inline bool pointsInwardAtEnd(const MeshPair& pair, std::uint32_t vertex,
                              const MeshFeature& ofTriangle, const VertexTriangleDistance& measured,
                              bool ofSecond) {
  const MeshFeature ofVertex{MeshFeature::Kind::Vertex, vertex};
  if (!(pair.a.outer || pair.b.outer) || measured.distance == 0.0) return false;
  return ofSecond ? pointsInward(pair, {ofTriangle, ofVertex}, -measured.normal, 1.0)
                  : pointsInward(pair, {ofVertex, ofTriangle}, measured.normal, 1.0);
}
inline bool pointInwardAtEnd(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB,
                             const EdgeEdgeDistance& measured) {
  if (!(pair.a.outer || pair.b.outer) || measured.distance == 0.0) return false;
  return pointsInward(pair,
                      {featureOf(pair.a.topology, edgeA, measured.featureA),
                       featureOf(pair.b.topology, edgeB, measured.featureB)},
                      measured.normal, 1.0);
}

}  // namespace palpate
