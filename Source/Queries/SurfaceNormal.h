#pragma once

#include <palpate/SpatialQueries.h>

#include "Bodies/Body.h"

#include <Eigen/Core>

#include <cstdint>

namespace palpate {

/// The outward normal of a body's surface at a point of an element: unit, also where the element
/// has no area.
///
/// Of a triangle mesh it is the winding normal of the face that holds the point, or the sum of the
/// normals around the edge or vertex that does, weighted by the angles of their faces there. Where
/// that sum has no direction, and for a disabled element, the element's own normal counts.
/// Of lines and points it has the direction `toward`; if that is 0, it is a coordinate axis.
///
/// weights  of the element's vertices at the point
/// Source   Baerentzen and Aanaes, Signed distance computation using the angle weighted
///          pseudonormal (2005).
Eigen::Vector3d surfaceNormal(const Body&, std::uint32_t element, const Eigen::Vector3d& weights,
                              const Eigen::Vector3d& toward);

/// Sets the normal of a point of this body's surface, also of a shape's. A point without element
/// on a mesh has none.
void setNormal(const Body&, const Eigen::Vector3d& toward, SurfacePoint&);

}  // namespace palpate
