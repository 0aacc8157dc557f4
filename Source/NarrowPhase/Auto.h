#pragma once

#include "NarrowPhase/NarrowPhase.h"

#include <span>

namespace palpate {

/// Method::Auto of findContacts(), where some features are slow and others fast.
///
/// A pair of features is a contact if at the step's end it is one of Method::Proximity at the
/// thickness and `extra`, or if it moves further than `slow` and has an impact in the step. The
/// first are described at the step's end, with a timeOfImpact of 1, unless the step may have
/// brought them together and they have an impact; all others as Method::Continuous does.
void findAuto(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

}  // namespace palpate
