#pragma once

#include <Eigen/Core>

#include <span>

namespace palpate {

/// The box that holds every vertex's displacement in a step.
struct MotionRange {
  Eigen::Vector3d lower = Eigen::Vector3d::Zero(), upper = Eigen::Vector3d::Zero();
};

/// From `before` to `now`, of the same size; zero of none.
/// Cost     about half a nanosecond a vertex, or what reading both takes.
MotionRange motionRange(std::span<const Eigen::Vector3d> before,
                        std::span<const Eigen::Vector3d> now);

/// L. No point of the one moves further relative to a point of the other, and none less far. What
/// both have in common, such as a translation, does not count.
double largestMotion(const MotionRange&, const MotionRange&);
double smallestMotion(const MotionRange&, const MotionRange&);

}  // namespace palpate
