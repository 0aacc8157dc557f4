#pragma once

#include "Math/ImpactQuery.h"

namespace palpate {

/// L: no two points of the features move further relative to each other, rounded up such that
/// features at a larger computed distance at the step's end were apart throughout: p - q of points
/// at fixed weights moves by a weighted mean of how the corners' differences move.
template <ImpactQuery::Kind kind>
double motionBound(const ImpactQuery&);

/// Whether features at this computed distance at the step's end may have touched before: whether
/// that is at most motionBound(). most: a bound on all of their motion, which answers sooner.
template <ImpactQuery::Kind kind>
bool mayHaveTouched(const ImpactQuery&, double distance, double most);

}  // namespace palpate
