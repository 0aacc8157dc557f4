#pragma once

#include "Octree/PointQueries.h"
#include "Mesh/Motion.h"
#include "Mesh/Revision.h"

#include <array>
#include <cstdint>

namespace palpate {

struct Geometry;

/// Measures how a rigid body moves: both ends of the step have the same positions in its frame. The
/// search for the vertices that move furthest uses its octree, and begins with the vertices found
/// last.
class RigidSearch {
 public:
  /// Bounds of the vertices' displacements, too large by a few rounding errors at most. Of a
  /// cylinder, all of its points count: its rim turns with its axis.
  MotionRange motion(const Geometry&);
  /// L: the largest distance, at any time of the step, between a vertex on its straight way and the
  /// same vertex on its arc. On arcs, the body turns evenly about one axis while it slides along
  /// that axis; such a motion exists between any two placements (Chasles). Too large by a few
  /// rounding errors at most.
  ///
  /// Source   Let a vertex at the distance r from the axis turn by the angle t. It is furthest from
  ///          its chord at half time, by r (1 - cos(t / 2)). The chord across the axis is
  ///          2 r sin(t / 2), so that this distance is half the chord times tan(t / 4).
  ///          A cylinder's axis is between its end centres. Where these are off by d, the unit
  ///          vectors along both axes differ by at most 4 d / length (Dunkl, Williams (1964)), and
  ///          the lateral surface by its radius times that more.
  double arcDeviation(const Geometry&);

 private:
  class Step;

  std::array<std::uint32_t, 7> m_furthest{};  ///< vertices of the last step, tried first
  double m_largest = 0;  ///< L: magnitude of the coordinates in the body's frame
  DerivedFrom<Revision> m_largestVersion;
};

}  // namespace palpate
