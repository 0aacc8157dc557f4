#pragma once

#include "CollisionDetection/PairTable.h"

#include <span>

namespace palpate {

/// L: no features of the two geometries are nearer, less radii: now, or at any time of the step if
/// the pair's method finds impacts. From boxes around the geometries; rounded down, at least 0.
double distanceBoundOf(const PairRecord&);

/// Sets the bound of the distance of each pair, and sorts the pairs in the order in which a
/// detection with a budget takes them (OctreeBasedCD::detectCollision()). Every pair is planned.
void orderByUrgency(std::span<PairRecord*> records);

/// Of pairs in that order: the first one that is unfinished, if no pair was before it, or only
/// pairs of a higher priority, the highest. It had all the time that it can have. Null: there is
/// none.
const PairRecord* findExceeding(std::span<PairRecord* const> records);

}  // namespace palpate
