#pragma once

#include "Mesh/Motion.h"
#include "Mesh/Revision.h"
#include "Octree/BoxMap.h"
#include "Octree/PointQueries.h"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

struct Geometry;

// A geometry that setTransform() moved: its boxes are of its body's frame, and nothing here reads
// all its vertices more than once.

/// Where a geometry's float frame has its origin in the world.
Eigen::Vector3d worldOrigin(const Geometry&);

/// Brings the boxes of a geometry's octree into the world, in floats about `origin`, grown by
/// `thickness` (in those floats): as it is now, or over the whole step. Nothing of one that is not
/// placed.
BoxMap worldMap(const Geometry&, const Eigen::Vector3d& origin, double thickness, bool wholeStep);

/// How a body moves of which both ends of the step have the same positions in its frame. The
/// vertices that move furthest are searched for in its octree, from those of the last search on.
class RigidSearch {
 public:
  /// Bounds at most a few roundings beyond the furthest vertices.
  MotionRange motion(const Geometry&);
  /// L: how far a vertex is at most, at any time of the step, from where it would be if the body
  /// turned evenly about one axis while it slid along it, which takes it from any place to any
  /// other (Chasles). At most a few roundings too much.
  ///
  /// Source   a vertex r from the axis, turned by the angle t, is furthest from its chord at half
  ///          time: r (1 - cos(t / 2)); its chord across the axis is 2 r sin(t / 2), so that is
  ///          half the chord times tan(t / 4).
  double arcDeviation(const Geometry&);

 private:
  class Step;

  std::array<std::uint32_t, 7> m_furthest{};  ///< vertices of the last step, tried first
  PointQueryStack m_queries;
  double m_largest = 0;  ///< L: magnitude of the coordinates in the body's frame
  DerivedFrom<1> m_largestOf;
};

}  // namespace palpate
