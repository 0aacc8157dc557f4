#pragma once

#include <palpate/Distance.h>

#include "NarrowPhase/NarrowPhase.h"
#include "NarrowPhase/Proximity.h"

#include <array>
#include <cstdint>
#include <optional>

namespace palpate {

/// Two edges, at least one of a line mesh, at most the thickness and their radii apart.
struct EdgesNearby {
  EdgeEdgeDistance centres;
  double distance;                      ///< L, less the radii
  std::array<MeshFeature, 2> features;  ///< that hold the closest points: vertices or edges
};

/// None if the edges are left out or too far apart. Self-collision: the lower edge first.
std::optional<EdgesNearby> measureEdges(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB);

/// The contacts of edges with lines, by Method::Proximity.
///
/// Distinct: of edges nearby, those whose closest points every other pair nearby that holds the
/// same two features shares, under the lowest such pair; other pairs are as near or nearer
/// elsewhere and report it there. Against triangles only where the line's own closest point is not
/// a vertex: vertices of lines are tested against whole triangles.
/// Source   Two edges at a common pair of points are nowhere nearer if neither comes nearer along
///          either edge alone (the squared distance is convex in both weights), so that vertices
///          which hold a contact are local minima over all their edges.
void testLineEdges(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB, ContactBuffers& out);

/// Whether a feature on the side of the pair's first or second mesh may be reported by edges.
inline bool isForEdges(const MeshPair& pair, const std::array<MeshFeature, 2>& features) {
  constexpr auto kVertex = MeshFeature::Kind::Vertex;
  return !(pair.b.topology.hasFaces() && features[0].kind == kVertex) &&
         !(pair.a.topology.hasFaces() && features[1].kind == kVertex);
}

}  // namespace palpate
