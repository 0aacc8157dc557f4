#pragma once

#include "Contact/Filters.h"
#include "Contact/MeshPair.h"

#include <cstddef>
#include <cstdint>

namespace palpate {

/// Contacts::Distinct for two edges, where at least one edge is of a line mesh: whether they report
/// their contact. nearby: of these edges.
///
/// Several nearby edge pairs may hold the same two features. A contact is reported only if all of
/// these pairs have their closest points on the two features, and only by the lowest pair.
/// Otherwise some pair is at least as near elsewhere, and reports its contact there. With a
/// triangle mesh, a contact is not reported where the closest point on the line is a vertex:
/// vertices of lines are tested against whole triangles. Nor is it where triangles exclude it.
///
/// The triangles around the mesh's closest edge or vertex exclude the direction to the line if it
/// leads into one of them. The line then comes nearer to that triangle. The contact is excluded if
/// the line's edge has a contact there that is at least as near: one of its ends over the triangle,
/// or a nearer one with another edge of the triangle. No triangles exclude a contact on a ridge or
/// a border.
///
/// Laws     (1) Of the contacts of a line's edge, the nearest one stays. (2) The rows of those that
///          stay keep the edge away from the others: see hasRidge().
/// Source   Take one point on each of two edges. If the distance does not decrease along either
///          edge alone, the edges are nowhere nearer: the squared distance is convex in both
///          weights. Vertices that hold a contact are therefore local minima over all their edges.
bool areDistinct(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB,
                 const NearbyEdges& nearby, std::size_t& exactDecisions);

}  // namespace palpate
