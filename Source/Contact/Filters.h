#pragma once

#include "Contact/MeshFeature.h"
#include "Contact/MeshPair.h"
#include "Core/Assert.h"

#include <array>
#include <cstdint>
#include <optional>

namespace palpate {

// The user's filters. StepFacts are recorded for all features, filtered or not, so that what
// Validity reports about sides and touching features does not depend on filters.

/// Whether a vertex of one feature is nearer to a vertex of the other than
/// PairSettings::restDistance, along the edges of the mesh at rest.
template <class Vertices, class Others>
bool areNearAtRest(const MeshPair& pair, const Vertices& vertices, const Others& others) {
  if (!pair.nearAtRest) return false;
  PALPATE_ASSERT(pair.self());
  for (const std::uint32_t v : vertices)
    for (const std::uint32_t w : others) {
      const auto after = (*pair.nearAtRest)[std::min(v, w)];
      if (v == w || std::binary_search(after.begin(), after.end(), std::max(v, w))) return true;
    }
  return false;
}

/// Whether a filter suppresses the contact of a vertex and a triangle. swapped: the vertex is of
/// MeshPair::b.
bool rejectsVertex(const MeshPair&, std::uint32_t vertex, std::uint32_t triangle, bool swapped);
bool rejectsEdges(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB);

/// Whether a contact points into a mesh with Sidedness::Outer. features: those that hold the
/// closest points. direction: from the pair's second mesh to the first, not zero. time: in [0, 1],
/// of the positions and the direction.
bool pointsInward(const MeshPair&, const std::array<MeshFeature, 2>& features,
                  const Eigen::Vector3d& direction, double time);

/// Whether a direction from a feature points below the mesh's surface at a time. A feature
/// between faces and the other side of a folded one are decided in double: within rounding of a
/// face's plane either answer is possible.
bool liesBelow(const TriangleMesh&, const MeshFeature&, const Eigen::Vector3d& direction,
               double time = 1.0);

/// Whether a feature is on the border of a surface: an edge of one triangle, or a vertex around
/// which the surface is not closed.
inline bool isOnBorder(const MeshTopology& topology, const MeshFeature& feature) {
  if (feature.kind == MeshFeature::Kind::Vertex) return topology.hasClosedStar[feature.id] == 0;
  return holdersOf(topology, feature).size() == 1;
}

/// Whether a vertex is beyond the border of a surface: its closest point is on the border, and the
/// way from there to the vertex is not along the normal of a triangle there, to either side.
bool isBeyondBorder(const TriangleMesh&, const MeshFeature& closest, const Eigen::Vector3d& way,
                    double time = 1.0);

/// pointsInward() at the step's end, for features with a measured distance. Features at distance 0
/// have no direction, and never point inward.
inline bool pointsInwardAtEnd(const MeshPair& pair, std::uint32_t vertex,
                              const MeshFeature& ofTriangle, const VertexTriangleDistance& measured,
                              bool swapped) {
  const MeshFeature ofVertex{MeshFeature::Kind::Vertex, vertex};
  if (!(pair.a.outerSideOnly || pair.b.outerSideOnly) || measured.distance == 0.0) return false;
  return swapped ? pointsInward(pair, {ofTriangle, ofVertex}, -measured.normal, 1.0)
                 : pointsInward(pair, {ofVertex, ofTriangle}, measured.normal, 1.0);
}
inline bool pointInwardAtEnd(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB,
                             const EdgeEdgeDistance& measured) {
  if (!(pair.a.outerSideOnly || pair.b.outerSideOnly) || measured.distance == 0.0) return false;
  return pointsInward(pair,
                      {featureOf(pair.a.topology, edgeA, measured.featureA),
                       featureOf(pair.b.topology, edgeB, measured.featureB)},
                      measured.normal, 1.0);
}

/// Two edges, at least one of a line mesh, whose distance less their radii is at most the
/// thickness.
struct NearbyEdges {
  EdgeEdgeDistance centres;
  double distance;                      ///< L, less the radii
  std::array<MeshFeature, 2> features;  ///< vertices or edges that hold the closest points
};

/// Returns nothing if the edges are excluded, filtered or too far apart. Self-collision: pass the
/// lower edge first. gap: if not null, receives the distance less the largest radii, L, of edges
/// that are not excluded, filtered or not.
std::optional<NearbyEdges> measureEdges(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB,
                                        double* gap = nullptr);

}  // namespace palpate
