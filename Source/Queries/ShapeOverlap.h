#pragma once

#include "Bodies/Body.h"
#include "Octree/PointQueries.h"
#include "Shapes/PlacedShape.h"
#include "Core/Buffer.h"

#include <palpate/AnalyticalGeometry.h>

#include <cstdint>
#include <vector>

namespace palpate {

/// Appends the elements whose distance from a point, less the radius, is at most `distance`, in any
/// order. Decided exactly. near: scratch.
void findWithin(const Body&, const Eigen::Vector3d& point, double distance, bool bruteForce,
                Buffer<std::uint32_t>& near, std::vector<std::uint32_t>& out);

/// Appends the elements that meet a shape at a pose, in any order. A line whose radii differ
/// between its ends is the hull of the balls there. Of other elements balls are decided as by
/// findWithin(). Hulls and boxes are decided exactly if elements have no radius, others in floating
/// point. bruteForce: every element is tested so.
///
/// Method   floats decide most nodes and elements for balls, capsules, boxes and hulls. Polygons
///          clipped in double decide most others.
/// kept: memory of shapes.
void findOverlapping(const Body&, const AnalyticalGeometry&, const Pose&, bool bruteForce,
                     KeptShapes& kept, Buffer<std::uint32_t>& near,
                     std::vector<std::uint32_t>& out);

}  // namespace palpate
