#pragma once

#include <palpate/FeaturePairs.h>

#include "NarrowPhase/NarrowPhase.h"
#include "NarrowPhase/Proximity.h"
#include "NarrowPhase/StepCheck.h"

#include <array>
#include <cstdint>
#include <optional>

namespace palpate {

/// Two edges, at least one of a line mesh, whose distance less their radii is at most the
/// thickness.
struct NearbyEdges {
  EdgeEdgeDistance centres;
  double distance;                      ///< L, less the radii
  std::array<MeshFeature, 2> features;  ///< vertices or edges that hold the closest points
};

/// Returns nothing if the edges are excluded, filtered or too far apart. Self-collision: pass the
/// lower edge first. check: if not null, records edges that are not excluded.
std::optional<NearbyEdges> measureEdges(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB,
                                        StepCheck* check = nullptr);

/// Appends the contact of two edges by Method::Proximity, where at least one edge is of a line
/// mesh.
///
/// Distinct: several nearby edge pairs may hold the same two features. A contact is reported only
/// if all of these pairs have their closest points on the two features, and only by the lowest
/// pair. Otherwise some pair is at least as near elsewhere, and reports its contact there. With a
/// triangle mesh, a contact is not reported where the closest point on the line is a vertex:
/// vertices of lines are tested against whole triangles. Nor is it where isExcludedByFaces() holds.
/// Source   Take one point on each of two edges. If the distance does not decrease along either
///          edge alone, the edges are nowhere nearer: the squared distance is convex in both
///          weights. Vertices that hold a contact are therefore local minima over all their edges.
void testLineEdges(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB, StepCheck&,
                   ContactBuffers& out);

/// Contacts::Distinct: whether the triangles around a mesh's closest edge or vertex exclude the
/// direction to the line, as it leads into one of them. The line then comes nearer to that
/// triangle. The contact is excluded if the line's edge has a contact there that is at least as
/// near: one of its ends over the triangle, or a nearer one with another edge of the triangle.
/// False on ridges and borders, and for two line meshes. nearby: of these edges.
///
/// Laws     (1) Of the contacts of a line's edge, the nearest one stays. (2) The rows of those that
///          stay keep the edge away from the others: see hasRidge().
bool isExcludedByFaces(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB,
                       const NearbyEdges& nearby);

/// Whether edge pairs report contacts between these features, of the pair's first and second mesh.
/// They do not report a vertex against a triangle mesh.
inline bool areReportedByEdges(const MeshPair& pair, const std::array<MeshFeature, 2>& features) {
  constexpr auto kVertex = MeshFeature::Kind::Vertex;
  return !(pair.b.topology.hasFaces() && features[0].kind == kVertex) &&
         !(pair.a.topology.hasFaces() && features[1].kind == kVertex);
}

}  // namespace palpate
