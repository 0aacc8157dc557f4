// Part of CollisionDetection/DiagnosticsInterface.h: contacts of a pair.
#include "Diagnostics/ContactsByBruteForce.h"
#include "CollisionDetection/DiagnosticsInterface.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Meeting.h"
#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

void detectPairByBruteForce(const PairRecord& record, ContactBuffers& contacts,
                            ContactBuffers& intersections) {
  MeshPair meshes = record.meshes();
  findContactsByBruteForce(record, everyFeature(record), contacts);
  const auto countA = static_cast<std::uint32_t>(meshes.a.topology.elements.size()),
             countB = static_cast<std::uint32_t>(meshes.b.topology.elements.size());
  const auto forEachPair = [&](auto&& f) {
    for (std::uint32_t a = 0; a < countA; ++a)
      for (std::uint32_t b = meshes.self() ? a + 1 : 0; b < countB; ++b)
        if (meshes.a.topology.isEnabled(a) && meshes.b.topology.isEnabled(b)) f(ElementPair{a, b});
  };
  if (meshes.step.checksStart)
    forEachPair([&](const ElementPair& pair) {
      contacts.facts.atStart =
          std::max(contacts.facts.atStart, meetingOf(meshes, true, pair, intersections));
    });
  if (!record.plan.runsIntersection ||
      !(contacts.facts.startsPiercing() || record.plan.startsIntersecting))
    return;
  if (meshes.step.motion > 0.0)
    forEachPair([&](const ElementPair& pair) { addCrossingsAtStart(meshes, pair, intersections); });
  PALPATE_ASSERT(record.plan.kind == PairKind::Meshes);
  meshes.settings.method = Method::Intersection;
  findContactsByBruteForce(meshes, intersections);
}

void detectVerticesByBruteForce(const PairRecord& record, std::span<const std::uint32_t> vertices,
                                ContactBuffers& contacts) {
  PALPATE_ASSERT(std::is_sorted(vertices.begin(), vertices.end()));
  FeatureLists features;
  features.verticesOfA.assign(vertices.begin(), vertices.end());
  findContactsByBruteForce(record, features, contacts);
}

}  // namespace palpate
