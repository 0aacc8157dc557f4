#pragma once

#include <palpate/Settings.h>

#include "Mesh/TriangleMesh.h"
#include "Math/NormalCone.h"

#include <algorithm>
#include <cstdint>
#include <span>
#include <tuple>

namespace palpate {

// Conditions of Contacts::Distinct that impacts and contacts with shapes share.

/// Whether a contact with this time and distance is early enough to stand for another one: it is
/// earlier, or as early and nearer; with a triangle's interior it may be up to timeTolerance later.
inline bool standsInTime(bool isOfFace, double time, double distance, double otherTime,
                         double otherDistance, const PairSettings& settings) {
  return isOfFace ? time <= otherTime + settings.continuous.timeTolerance
                  : std::tie(time, distance) < std::tie(otherTime, otherDistance);
}

/// Whether a plane contains these vertices at the step's end.
inline bool areIn(const TangentPlane& plane, const TriangleMesh& mesh,
                  std::span<const std::uint32_t> vertices) {
  return std::all_of(vertices.begin(), vertices.end(),
                     [&](std::uint32_t v) { return plane.touches(mesh.now[v], mesh.radius(v)); });
}

}  // namespace palpate
