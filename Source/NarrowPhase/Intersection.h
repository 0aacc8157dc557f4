#pragma once

#include "NarrowPhase/NarrowPhase.h"

#include <span>

namespace palpate {

/// Method::Intersection of findContacts().
///
/// Of two triangles that intersect: if features touch, every vertex-triangle and edge-edge pair at
/// distance zero; else, if two edges of one cross the other, the vertex that these share; else the
/// two edges that cross the other triangle. What touches comes out once, from the pair of its
/// owners; other contacts come from several pairs, each time with the same bits.
///
/// A vertex that lies behind the triangle, seen along its winding normal, has a negative distance.
/// The normal of a vertex-triangle contact is the winding normal where the triangle's interior
/// holds the closest point, and where the vertex touches the triangle. Where an edge or a corner
/// holds it the normal is along the line through both points, on the winding normal's side. Of a
/// triangle without area, and of touching parallel edges, it is the axis that <palpate/Distance.h>
/// names. Distances of edges have no sign.
///
/// Self-collision: two triangles with common vertices intersect if a vertex touches the other
/// triangle and is not a corner of it, if an edge of each touch that have no common vertex, or if
/// an edge crosses the other triangle's interior. This last alone gives no contact: no two edges of
/// one cross the other, and what touches at the common vertex is excluded. A triangle across that
/// edge gives one, if there is one and it has no vertex in common with the other. Pairs with
/// common vertices must be among the candidates.
void findIntersections(const MeshPair&, std::span<const ElementPair> candidates,
                       ContactBuffers& out);

/// The same of one pair of triangles, without the filters of findIntersections().
void addIntersection(const MeshPair&, const ElementPair&, ContactBuffers& out);

}  // namespace palpate
