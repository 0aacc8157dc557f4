#pragma once

#include "Shapes/Polytope.h"

#include <Eigen/Core>

#include <functional>

namespace palpate {

/// The furthest point of a body along a direction, L in the world.
using Support = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

/// A translation of a that separates the convex hulls of two bodies.
struct HullSeparation {
  Eigen::Vector3d direction;  ///< unit; 0: none was found, because the hulls lie in one plane
  double depth;               ///< L; negative: the hulls are apart
  double gap;                 ///< L: no shorter translation than depth - gap separates the hulls
};

/// The least translation that separates two hulls, by the Minkowski difference of both
/// (Shape::distanceFrom()). wanted: L, the search ends where the gap is at most this, or where
/// kMaxPoints points of the difference are known.
///
/// Cost     two supports for each point. Polyhedra need some ten to a hundred points.
HullSeparation separateHulls(const Support& a, const Support& b, double wanted, Polytope& scratch);

}  // namespace palpate
