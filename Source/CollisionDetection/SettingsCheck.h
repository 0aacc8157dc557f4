#pragma once

#include <palpate/DistanceField.h>
#include <palpate/Settings.h>

#include "CollisionDetection/Geometry.h"
#include "Validity/Support.h"

namespace palpate {

/// Returns the settings, or throws InvalidSettings with the fault.
const Settings& checked(const Settings&);

/// Returns the row of the table of support by which a pair is answered. Throws UnsupportedMethod or
/// InvalidSettings with the fault.
/// isPlaced: of a.
const SupportedPairs& checkPair(const Geometry& a, const Geometry& b, const PairSettings&,
                                bool isPlaced);
inline const SupportedPairs& checkPair(const Geometry& a, const Geometry& b,
                                       const PairSettings& settings) {
  return checkPair(a, b, settings, a.body.isPlaced());
}

/// Throws unless a pair by Method::DistanceField can do with this field of its body, or null.
/// largestRadius: L, of the other geometry. named: the geometry of the error.
void checkField(const Geometry& a, const Geometry& b, const DistanceField*, const PairSettings&,
                double largestRadius, GeometryId named);

inline constexpr const char* kRigidWithItself =
    "a geometry that setTransform() moves cannot be tested against itself";

}  // namespace palpate
