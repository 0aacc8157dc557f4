#pragma once

#include "NarrowPhase/NarrowPhase.h"

#include <span>

namespace palpate {

/// Contacts of the features that the primitives of a pair's mesh own with the other's shape.
///
/// All: every vertex, edge and triangle at most the thickness and its radius from the shape, at its
/// point nearest to it. Distinct: those of them of which that point is strictly inside.
///
/// Continuous: those within the distance before the step, as Distinct, at time 0; else vertices
/// that come so near to the shape, edges that do to its edges, and triangles to its corners, where
/// the nearest point is then strictly inside: whatever first comes so near is one of them. A plane
/// has no edges and no corners. Edges and triangles come near to a cylinder as a whole.
void findShapeContacts(const MeshPair&, std::span<const std::uint32_t> primitives,
                       ContactBuffers& out);

/// The contact of a pair of two shapes, if they are near enough; Continuous: where they first are
/// within the step.
void findShapePair(const MeshPair&, ContactBuffers& out);

}  // namespace palpate
