#pragma once

#include "Mesh/Positions.h"
#include "Mesh/TriangleMesh.h"

#include <Eigen/Core>

#include <span>

namespace palpate {

/// The box that contains the displacements of vertices in a step.
struct MotionRange {
  Eigen::Vector3d lower = Eigen::Vector3d::Zero(), upper = Eigen::Vector3d::Zero();
  bool isEmpty = true;  ///< no vertices were added
  void add(const MotionRange&);
  bool isZero() const { return lower.isZero(0.0) && upper.isZero(0.0); }
};

/// The range of displacements from `before` to `now`, which have the same size; zero if they are
/// empty.
/// Cost     about a third of a nanosecond a vertex, or the time to read both, which is twice that
///          from the second-level cache; ten nanoseconds for placed positions.
MotionRange motionRange(std::span<const Eigen::Vector3d> before,
                        std::span<const Eigen::Vector3d> now);
MotionRange motionRange(const Positions& before, const Positions& now);

/// L. Bounds on the motion of a point of one range relative to a point of the other: none moves
/// further, and none less far. Common motion, such as a translation of both, does not count.
double largestMotion(const MotionRange&, const MotionRange&);
double smallestMotion(const MotionRange&, const MotionRange&);
/// The share of pairs of one vertex of each that move further than `limit`, L, relative to each
/// other, for a sample of a few hundred pairs.
double fastShare(const TriangleMesh&, const TriangleMesh&, double limit);

}  // namespace palpate
