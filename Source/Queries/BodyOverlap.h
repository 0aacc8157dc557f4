#pragma once

#include "Queries/BodyPair.h"

#include <vector>

namespace palpate {

/// Whether the insides of two bodies have a common point. intersecting: the pairs of triangles that
/// have a common point, by elements.
///
/// Surfaces that pierce each other decide, else a part that is inside the other body. Where
/// surfaces only touch, all vertices are tested, and points beside the common points of triangles.
/// Each of these tests is exact and proves an overlap. Faces that lie in each other within rounding
/// may overlap by less than the points are beside them, which is then a touch. At the pair's
/// deadline the answer is false.
bool overlap(const BodyPair&, CountedVector<BodyPair::IntersectingTriangles>& intersecting);

/// Whether a mesh is convex: its faces are seen from one point inside each on one side, and no
/// vertex is in front of a neighbouring face by more than kExitSlack of the largest coordinate.
bool isConvex(const BodyPair&, bool ofA);

}  // namespace palpate
