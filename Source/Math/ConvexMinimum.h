#pragma once

#include "Math/Tolerances.h"
#include "Core/Assert.h"

namespace palpate {

/// The value and a slope of a convex function at a place.
struct Tangent {
  double at, value, slope;
  /// A lower bound of the function.
  double operator()(double t) const { return value + (t - at) * slope; }
};

/// The place in [0, 1] at which a convex function is least, or any place at which it is at most 0.
/// tangentAt(t): its tangent at t. At a kink, any slope between those of both sides.
template <class F>
Tangent leastTangent(F&& tangentAt) {
  const Tangent low = tangentAt(0.0), high = tangentAt(1.0);
  Tangent left = low, right = high, least = high.value < low.value ? high : low;
  while (least.value > 0.0 && left.slope < 0.0 && right.slope > 0.0 &&
         right.at - left.at > kEdgeWeight) {
    const Tangent middle = tangentAt(0.5 * (left.at + right.at));
    if (middle.value < least.value) least = middle;
    if (middle.slope == 0.0) break;
    (middle.slope < 0.0 ? left : right) = middle;
  }
  PALPATE_ASSERT(least.at >= 0.0 && least.at <= 1.0 && !(least.value > low.value));
  return least;
}

}  // namespace palpate
