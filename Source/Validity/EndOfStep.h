#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/NarrowPhase.h"

#include <optional>

namespace palpate {

/// What a step's contacts tell of its end.
struct EndOfStep {
  std::optional<ElementPair> intersecting;
  /// Without one: no triangles intersect, if none did at the start.
  bool isKnown = true;
};

/// Triangles that were apart can only intersect where features of theirs have touched. contacts:
/// all of the step, in their order, by impact wherever features may have touched.
/// Cost     checks at most one triangle pair for each contact and a few more; where these do not
///          suffice nothing is known.
EndOfStep checkEnd(const MeshPair&, const CollisionData::Contents& contacts,
                   ContactBuffers& counts);

}  // namespace palpate
