#pragma once

#include "Contact/ContactBuffers.h"
#include "Contact/Contents.h"
#include "Contact/MeshPair.h"
#include "NarrowPhase/FeaturePairs.h"

#include <span>

namespace palpate {

/// Appends the contacts of the candidate triangle pairs. Each contact is appended once over all
/// batches of a frame. Only Method::Intersection may repeat contacts; orderContacts() removes the
/// copies. Self-collision: pass each unordered triangle pair once. Adjacent pairs and (t, t) may be
/// among them: pairs that own no feature pair cost little.
/// Threads  safe for different output buffers.
void findContacts(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

}  // namespace palpate
