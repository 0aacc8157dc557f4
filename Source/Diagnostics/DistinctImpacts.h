#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/NarrowPhase.h"

namespace palpate {

// Contacts::Distinct for impacts, as an audit expects it. Includes nothing of the rule in Contact.
// Without effect on pairs that report no impacts.

/// Drops excluded impacts for which others stand.
void dropExcludedImpacts(const MeshPair&, CollisionData::Contents& expected);
/// Drops contacts for which an earlier contact is kept. The earlier contact is either expected,
/// too, or in the answer if the sample does not cover it.
void dropRepeatedImpacts(const MeshPair&, const CollisionData& answer,
                         CollisionData::Contents& expected);

}  // namespace palpate
