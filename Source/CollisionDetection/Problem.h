#pragma once

#include <palpate/CollisionProblem.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairTable.h"

namespace palpate {

/// What a detection would be given now.
CollisionProblem problemOf(const Settings&, const GeometryTable&, const PairTable&);

}  // namespace palpate
