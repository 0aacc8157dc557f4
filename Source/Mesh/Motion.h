#pragma once

#include "Mesh/Positions.h"
#include "Mesh/TriangleMesh.h"

#include <Eigen/Core>

#include <span>

namespace palpate {

/// The box that holds the displacements of vertices in a step.
struct MotionRange {
  Eigen::Vector3d lower = Eigen::Vector3d::Zero(), upper = Eigen::Vector3d::Zero();
  bool isEmpty = true;  ///< of no vertices
  void add(const MotionRange&);
  bool isZero() const { return lower.isZero(0.0) && upper.isZero(0.0); }
};

/// From `before` to `now`, which are as many; zero of none.
/// Cost     about a third of a nanosecond a vertex, or what reading both takes, which is twice that
///          from the second cache; ten where they are placed.
MotionRange motionRange(std::span<const Eigen::Vector3d> before,
                        std::span<const Eigen::Vector3d> now);
MotionRange motionRange(const Positions& before, const Positions& now);

/// L. No point of the one moves further relative to a point of the other, and none less far. What
/// both have in common, such as a translation, does not count.
double largestMotion(const MotionRange&, const MotionRange&);
double smallestMotion(const MotionRange&, const MotionRange&);
/// L: the root mean square over pairs of a vertex of each, of a sample of a few hundred.
double meanMotion(const TriangleMesh&, const TriangleMesh&);

}  // namespace palpate
