#pragma once

#include "NarrowPhase/NarrowPhase.h"

#include <span>

namespace palpate {

/// Implements Method::Proximity of findContacts().
void findProximity(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

}  // namespace palpate
