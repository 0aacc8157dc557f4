#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/PairTraversal.h"
#include "Bodies/Body.h"
#include "Shapes/Shape.h"

#include <memory>

namespace palpate {

/// The least distance between two geometries, of which at least one has elements. Of equally near
/// pairs of elements, by computed distance, that of the lowest element of a, then of b. 0 if
/// they have a common point, which is decided exactly for elements without radii. Both points have
/// element kNoElement, and the distance is infinite, if a mesh has no elements.
///
/// Method   descent into both octrees, from a pair of elements that is likely near. A pair of nodes
///          is skipped if its boxes, in the frame of a, are further apart than the best pair of
///          elements, or if their heights along the direction of that pair are. scratch: null
///          before the first call.
GeometryDistance distanceBetween(const Body& a, const Body& b, bool bruteForce,
                                 std::unique_ptr<PairScratch>& scratch);
/// The same for a geometry with elements and a shape with this id, which is solid.
GeometryDistance distanceBetween(const Body&, GeometryId, const Shape&, bool bruteForce);

/// The same for two shapes. At most one may be a plane.
GeometryDistance distanceBetween(GeometryId, const Shape&, GeometryId, const Shape&,
                                 ShapePairScratch&);

/// The least distance from a segment or point pq. None within maxDistance: the element is
/// kNoElement.
struct SegmentDistance {
  double weight;  ///< of q
  SurfacePoint nearest;
};
SegmentDistance distanceFromSegment(const Body&, const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                                    double maxDistance, bool bruteForce);

}  // namespace palpate
