#pragma once

#include "Math/ImpactQuery.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <array>
#include <optional>

namespace palpate {

/// L: the radius at each of ImpactQuery::vertices. Triangles have none; a segment {p, q, q} and a
/// point {p, p, p} may.
using FeatureRadii = std::array<double, 4>;

/// When two features come nearer than a StepGuard lets them. The radius of a feature is the largest
/// at its vertices, and r the sum of both.
///
/// Without radii     when they touch, decided exactly.
/// Begins beyond r   when they come within r, as findApproach() reports.
/// Begins within r   when they come nearer than they began, less kNearingSlack of the largest
///                   coordinate difference and r, and kNearingTolerances time tolerances of their
///                   motion. This also holds if rounding cannot tell whether they begin beyond r.
/// If a segment's radius varies, r is too large for most of it. If such features begin within r,
/// and their pieces (kTaperPieces) beyond theirs, a time is found up to which no pieces can have
/// come within their radii.
///
/// Laws      never late. Features whose vertices all have one motion are reported only if they
///           touch without their radii.
ImpactResult findNearing(const ImpactQuery&, const FeatureRadii&, double tolerance);

/// Whether features that touch at the step's start certainly do not touch at any later time: there
/// is a plane of which they are on two sides at the start, and strictly on the same sides at the
/// end. Exact for the planes that it tries: that of a triangle or of two edges, and those through
/// an edge across it.
bool certainlyPart(const ImpactQuery&);

/// Goes through times up to which a clearance cannot be used up; none if that is the whole step. 0
/// if there is no clearance at the start. clearanceAt(time): a lower bound, L. motion: L, a bound
/// on how much it falls in the whole step.
template <class ClearanceAt>
std::optional<double> timeOfNoClearance(double motion, double tolerance,
                                        ClearanceAt&& clearanceAt) {
  PALPATE_ASSERT(motion >= 0.0 && tolerance > 0.0);
  double time = 0;
  for (int i = 0; i < kMostClearances; ++i) {
    const double clearance = clearanceAt(time);
    if (!(clearance > tolerance * motion)) break;
    if (!(clearance < (1.0 - time) * motion)) return {};
    time += clearance / motion * (1.0 - kQuotientError);
  }
  PALPATE_ASSERT(time >= 0.0 && time <= 1.0);
  return time;
}

}  // namespace palpate
