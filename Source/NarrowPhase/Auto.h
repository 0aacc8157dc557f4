#pragma once

#include "NarrowPhase/NarrowPhase.h"

#include <span>

namespace palpate {

/// Implements Method::Auto of findContacts() for pairs with both slow and fast features.
///
/// A feature pair is a contact in two cases:
/// (1) Method::Proximity reports it at the step's end, with StepPlan::extraThickness added.
/// (2) It moves further than StepPlan::slowMotion and has an impact in the step.
/// A contact of case 1 describes the step's end and has a timeOfImpact of 1. If the step may have
/// brought the features together and they have an impact, it describes the impact instead. Contacts
/// of case 2 are described as by Method::Continuous.
void findAuto(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

}  // namespace palpate
