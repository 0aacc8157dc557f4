#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/BodyPenetration.h"
#include "Bodies/Body.h"
#include "Shapes/Shape.h"

namespace palpate {

/// penetrationOf() where at least one body is a shape (SpatialQueries::penetration()). Two-sided
/// planes, and two planes, must have been refused.
///
/// Method   Two shapes have a signed distance. A plane and a mesh have one direction. Other shapes
///          are enclosed by a mesh. From where that is separated, a round shape goes back along the
///          direction by its distance from the mesh, which cannot pass the place where they touch.
///          If the mesh is convex, the distance of the Minkowski difference gives the direction.
Penetration shapePenetration(const Body& a, const Body& b, Engine, const OctreeSettings&,
                             PenetrationScratch&, ShapePairScratch&);

}  // namespace palpate
