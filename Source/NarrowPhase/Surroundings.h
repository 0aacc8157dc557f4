#pragma once

#include "NarrowPhase/Continuous.h"
#include "Math/MovingStar.h"

#include <array>
#include <cstdint>

namespace palpate {

/// Finds what surrounds a touch of two features (Math/MovingStar.h has the numbers of `touch`, and
/// `place` of a vertex and a triangle).
template <ImpactQuery::Kind kind>
void findSurroundings(const Features<kind>& features, std::uint32_t firstId, std::uint32_t secondId,
                      std::array<int, 2> touch, const PlaceOnSegment& place,
                      TouchSurroundings& around);

}  // namespace palpate
