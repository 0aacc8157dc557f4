#pragma once

#include "NarrowPhase/NarrowPhase.h"
#include "Math/TriangleIntersection.h"

#include <span>

namespace palpate {

/// Implements Method::Intersection of findContacts().
///
/// IntersectionContacts.h has the contacts of two intersecting triangles.
///
/// Self-collision: two triangles with common vertices intersect in three cases:
/// (1) A vertex touches the other triangle and is not a corner of it.
/// (2) An edge of one touches an edge of the other, and these have no common vertex.
/// (3) An edge crosses the other triangle's interior.
/// Case 3 alone gives no contact by rules 3 to 5: no two edges of one triangle cross the other,
/// and features that touch at the common vertex are excluded. Pairs with common vertices must be
/// among the candidates.
void findIntersections(const MeshPair&, std::span<const ElementPair> candidates,
                       ContactBuffers& out);

/// Does the same for one pair of triangles, without keepPossiblyIntersecting().
void addIntersection(const MeshPair&, const ElementPair&, ContactBuffers& out);

/// How two triangles of the meshes intersect, at the step's start or at its end.
TriangleIntersection intersectionOf(const MeshPair&, bool atStart, const ElementPair&, SignCounts&);
/// keepPossiblyIntersecting() at the step's start or at its end.
void keepPossible(const MeshPair&, bool atStart, std::span<const ElementPair> candidates,
                  Buffer<PossibleIntersection>& possible);
/// Appends to out.crossingsAtStart how triangles cross at the step's start.
void findCrossingsAtStart(const MeshPair&, std::span<const ElementPair> candidates,
                          ContactBuffers& out);
void addCrossingsAtStart(const MeshPair&, const ElementPair&, ContactBuffers& out);

}  // namespace palpate
