#pragma once

#include "Mesh/Motion.h"
#include "Mesh/Revision.h"
#include "Octree/PointQueries.h"

#include <array>
#include <cstdint>

namespace palpate {

struct Geometry;

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
