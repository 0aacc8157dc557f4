#pragma once

#include "Core/Buffer.h"
#include "Octree/PointQueries.h"
#include "Queries/SearchableGeometry.h"

#include <palpate/AnalyticalGeometry.h>

#include <cstdint>
#include <vector>

namespace palpate {

<<<<<<< HEAD
/// Appends the elements that meet a shape at a pose, in any order. bruteForce: every element is
/// tested, by the shape's distance alone.
///
/// Method   floats decide most nodes and elements for spheres, capsules, boxes and hulls. Polygons
///          clipped in double decide most others. The shape's distance decides the rest.
void findOverlapping(const SearchableGeometry&, const AnalyticalGeometry&, const RigidTransform&,
                     bool bruteForce, PointQueryStack&, Buffer<std::uint32_t>& near,
                     std::vector<std::uint32_t>& out);

/// Appends the elements whose distance from a point, less the radius, is certainly at most
/// `distance`, and to `undecided` the places of those that may be. Returns false, without a result,
/// where floats cannot tell.
bool findWithin(const SearchableGeometry&, const Eigen::Vector3d& point, double distance,
                std::vector<std::uint32_t>& elements, Buffer<std::uint32_t>& undecided);
=======
/// Appends the elements that meet a shape, in any order. bruteForce: every element is tested. Balls
/// are decided exactly, and so are hulls and boxes if elements have no radius; others in floating
/// point.
void findOverlapping(const SearchableGeometry&, const Shape&, bool bruteForce, PointQueryStack&,
                     Buffer<std::uint32_t>& near, std::vector<std::uint32_t>& out);
>>>>>>> querytests

}  // namespace palpate
