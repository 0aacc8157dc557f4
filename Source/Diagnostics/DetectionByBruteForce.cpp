#include "CollisionDetection/DiagnosticsInterface.h"
#include "Diagnostics/ContactsByBruteForce.h"
#include "NarrowPhase/Piercing.h"

#include <algorithm>

namespace palpate {

void detectPairByBruteForce(const PairRecord& record, ContactBuffers& contacts,
                            ContactBuffers& intersections) {
  MeshPair meshes = record.meshes();
  findContactsByBruteForce(meshes, contacts);
  const auto countA = static_cast<std::uint32_t>(meshes.a.topology.triangles.size()),
             countB = static_cast<std::uint32_t>(meshes.b.topology.triangles.size());
  for (std::uint32_t a = 0; a < countA && meshes.step.checksStart; ++a)
    for (std::uint32_t b = meshes.self() ? a + 1 : 0; b < countB; ++b)
      if (meshes.a.topology.isEnabled(a) && meshes.b.topology.isEnabled(b))
        contacts.facts.atStart = std::max(
            contacts.facts.atStart, meetingOf(meshes, true, ElementPair{a, b}, intersections));
  if (!record.plan.runsIntersection ||
      !(contacts.facts.startsPiercing() || record.plan.startsIntersecting))
    return;
  meshes.settings.method = Method::Intersection;
  findContactsByBruteForce(meshes, intersections);
}

void detectVerticesByBruteForce(const PairRecord& record, std::span<const std::uint32_t> vertices,
                                ContactBuffers& contacts) {
  FeatureLists features;
  features.verticesOfA.assign(vertices.begin(), vertices.end());
  findContactsByBruteForce(record.meshes(), features, contacts);
}

}  // namespace palpate
