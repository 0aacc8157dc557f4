#pragma once

#include "Features.h"

#include "Unit/Math/ImpactOracle.h"

#include <vector>

namespace palpate::stability {

/// Two features that touch within a frame, decided in rational arithmetic that shares nothing with
/// the library.
struct Touch {
  FeaturePair features;
  impact::Real time;
  /// On which side of the common plane they were just before; 0: touching from the start.
  int side = 0;
  impact::Polynomial height;  ///< over the common plane, times an area
  /// What spans the common plane, over time: two sides of the triangle, or edge a and edge b.
  std::array<impact::Vector, 2> span;

  bool isBefore(double answered) const;
  /// At most 1e-6 early, never late.
  bool isTimely(double answered) const;
  /// Whether a normal, from the second feature towards the first, points to the other side at this
  /// time; a normal within 6 degrees of the plane does not say.
  bool isTurned(const Eigen::Vector3d& answered, double at) const;
};

/// Features that touch within the frame's motion.
std::vector<Touch> touchesWithin(const Case::Frame& before, const Case::Frame& now);

}  // namespace palpate::stability
