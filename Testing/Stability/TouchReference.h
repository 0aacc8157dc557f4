#pragma once

#include "Features.h"

#include "Unit/Math/ImpactOracle.h"

#include <vector>

namespace palpate::stability {

/// The reference for two features that touch within a frame, in rational arithmetic that shares no
/// code with the library.
struct Touch {
  FeaturePair features;
  impact::Real time;
  /// Side of the common plane just before the touch; 0 if the features touch from the start.
  int side = 0;
  impact::Polynomial height;  ///< height over the common plane, times an area
  /// Vectors that span the common plane over time, times a positive number: two sides of the
  /// triangle, or both edges.
  std::array<impact::Vector, 2> span;

  /// True if the touch is earlier than the reported time.
  bool isBefore(double reported) const;
  /// True if the reported time is not late, and at most 1e-6 early.
  bool isTimely(double reported) const;
  /// True if a reported normal, from the second feature to the first, points to the wrong side at
  /// this time. A normal within 6 degrees of the plane does not count.
  bool isWrongSide(const Eigen::Vector3d& reported, double at) const;
};

/// All feature pairs that touch within the frame.
std::vector<Touch> touchesWithin(const Case::Frame& before, const Case::Frame& now);

}  // namespace palpate::stability
