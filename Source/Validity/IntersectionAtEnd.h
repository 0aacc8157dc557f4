#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/Meeting.h"

#include <optional>

namespace palpate {

/// How surfaces meet at a step's end, as far as its contacts determine this.
struct IntersectionAtEnd : SurfaceMeeting {
  /// If no pair of triangles pierces: whether `meeting` is certain, provided that none pierced at
  /// the step's start.
  bool isKnown = true;
};

/// Tests the triangles around a step's contacts for intersections at the step's end. This suffices
/// because triangles that were apart, or only touched, can only intersect where their features have
/// touched.
/// contacts: all contacts of the step, sorted. Features that may have touched must be among them by
/// their impacts.
/// Cost     tests at most one triangle pair for each contact and 32 more. If these do not suffice,
///          isKnown is false.
IntersectionAtEnd checkEnd(const MeshPair&, const CollisionData::Contents& contacts,
                           ContactBuffers& counts);

}  // namespace palpate
