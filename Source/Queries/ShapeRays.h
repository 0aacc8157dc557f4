#pragma once

#include <palpate/SpatialQueries.h>

#include "Shapes/Shape.h"

#include <optional>
#include <vector>

namespace palpate {

/// Appends the hits of a ray on the surface of an analytical shape, by ascending t: where it enters
/// and where it leaves. Hulls and boxes are decided exactly on their placed corners, other shapes
/// in floating point.
void addShapeHits(GeometryId, const Shape&, const Ray&, std::vector<RayHit>& out);

/// The point of a shape's surface that is nearest to a point. The distance is negative inside.
SurfacePoint closestPointOnShape(GeometryId, const Shape&, const Eigen::Vector3d& point);

}  // namespace palpate
