#pragma once

#include "Math/ImpactQuery.h"

namespace palpate {

/// L: no two points of the features move further relative to each other. If the computed distance
/// at the step's end is larger than this bound, the features were apart throughout. Rounding errors
/// are included. Derivation: p - q of points at fixed weights moves by a weighted mean of the
/// motions of the corners' differences.
template <ImpactQuery::Kind kind>
double motionBound(const ImpactQuery&);

/// Whether features at this computed distance at the step's end may have touched before: whether
/// the distance is at most motionBound(). motionLimit: a bound on the motion of all features, which
/// often decides sooner.
template <ImpactQuery::Kind kind>
bool mayHaveTouched(const ImpactQuery&, double distance, double motionLimit);

}  // namespace palpate
