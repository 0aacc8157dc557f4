#pragma once

#include "CollisionDetection/GuardedParts.h"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Fraction of the step: the time tolerance of a StepGuard's detections. Far below any fraction
/// that matters, so that a step is not shortened to nothing where time is left.
constexpr double kGuardTolerance = 0x1p-40;
/// The same for pairs without radii: exact arithmetic would decide smaller ones. Early times are
/// computed again.
constexpr double kTouchTolerance = 0x1p-20;

/// Features that touch in a guarded step, by the parts of their vertices.
struct GuardedTouch {
  /// A part, and how it moves along the normal.
  struct Mover {
    std::uint32_t part;  ///< GuardedParts::kNone: vertices at rest
    double approach;     ///< L in the step as it is now; negative: it comes nearer
  };
  std::array<Mover, 4> movers;
  double time;
  bool atStart;  ///< at the step's start, so that shortening does not help
};

/// Writes the touches among the pairs' contacts. fractions: of their steps, by part. Throws
/// ImpactRemains if no part of a touch is free and has a fraction above 0.
void findTouches(SeparateSearches, const GuardedParts&, std::span<const double> fractions,
                 std::vector<GuardedTouch>& out);

}  // namespace palpate
