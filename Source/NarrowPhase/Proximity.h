#pragma once

#include "NarrowPhase/NarrowPhase.h"

#include <span>

namespace palpate {

/// Implements Method::Proximity of findContacts().
///
/// Self-collision with Contacts::Distinct: if the closest points are two vertices, the contact
/// names the lower one as its vertex. The triangles around a vertex neither report nor suppress
/// contacts of that vertex.
void findProximity(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

}  // namespace palpate
