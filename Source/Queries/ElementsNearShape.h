#pragma once

#include "Bodies/Body.h"
#include "Octree/PointQueries.h"

namespace palpate {

/// Finds all elements in the geometry's octree that are within `maxDistance` of the shape at some
/// time of the step, and some more. before, now: the shape at the ends of the step. Pass the same
/// object twice for the step's end alone.
///
/// Source   The distance to a convex shape is convex. Over a box it is therefore at least the
///          distance at the centre minus what the gradient there takes away up to a corner.
void findElementsNear(const Body&, const Shape& before, const Shape& now, double maxDistance,
                      Buffer<std::uint32_t>& out);
/// The same for a box in the world, which encloses the whole step or the step's end.
void findElementsNear(const Body&, const Eigen::AlignedBox3d& box, bool wholeStep,
                      Buffer<std::uint32_t>& out);

}  // namespace palpate
