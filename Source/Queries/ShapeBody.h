#pragma once

#include <palpate/Settings.h>

#include "Bodies/Body.h"
#include "Shapes/Shape.h"

#include <memory>

namespace palpate {

/// A mesh with an octree that encloses a shape with volume, in the world: a box's or a hull's own
/// faces, or the hull of points around a sphere, capsule or cylinder. Null for a shape without
/// volume. No point of the hull is further from a round shape than 3 % of the radius.
///
/// scale: of the float frame, that of the geometry beside which it is searched.
std::unique_ptr<Body> meshAround(GeometryId, const Shape&, double scale, const OctreeSettings&);

}  // namespace palpate
