#pragma once

#include "Geometry/Positions.h"

#include <Eigen/Core>

#include <cstddef>

namespace palpate {

/// The displacements of vertices in a step: the box that holds them, and their sums.
struct MotionRange {
  Eigen::Vector3d lower = Eigen::Vector3d::Zero(), upper = Eigen::Vector3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0;  ///< sum of squared lengths
  double count = 0;
  void add(const MotionRange&);
  bool isZero() const { return lower.isZero(0.0) && upper.isZero(0.0); }
};

/// Of vertices [begin, end) from `before` to `now`; zero of none.
/// Cost     about half a nanosecond a vertex, or what reading both takes; ten where they are placed.
MotionRange motionRange(const Positions& before, const Positions& now, std::size_t begin,
                        std::size_t end);

/// L. No point of the one moves further relative to a point of the other, and none less far. What
/// both have in common, such as a translation, does not count.
double largestMotion(const MotionRange&, const MotionRange&);
double smallestMotion(const MotionRange&, const MotionRange&);
/// The root mean square over all pairs of a vertex of each; approximate.
double meanMotion(const MotionRange&, const MotionRange&);

}  // namespace palpate
