#pragma once

#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/Settings.h>

#include "Diagnostics/ContactsByBruteForce.h"

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Draws at most settings.features of all features that the pair's method tests, each with the same
/// probability. The same seed, frame and pair give the same sample.
FeatureLists drawFeatures(const Question&, const AuditSettings&, std::uint64_t frame);

/// Compares `data` with brute force for a drawn sample of features. Appends false negatives, false
/// positives, and contacts that differ. For Method::Auto it appends false negatives only, and with
/// earliestTimeOnly impacts before the reported time. sidesAreKnown: Auto may leave out contacts of
/// vertices whose side is known (Answer).
void audit(const Question&, bool sidesAreKnown, const CollisionData& data, const AuditSettings&,
           std::uint64_t frame, std::vector<AuditFailure>& out);

/// The problem reduced to one of its pairs.
CollisionProblem reducedToPair(const CollisionProblem&, GeometryId a, GeometryId b);

}  // namespace palpate
