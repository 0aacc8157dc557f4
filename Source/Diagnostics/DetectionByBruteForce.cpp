// Part of Search/BruteForce.h: contacts of a pair.
#include "Diagnostics/ContactsByBruteForce.h"
#include "Search/BruteForce.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Meeting.h"
#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

void detectPairByBruteForce(const Question& question, ContactBuffers& contacts,
                            ContactBuffers& intersections) {
  MeshPair meshes = question.meshes();
  findContactsByBruteForce(question, everyFeature(question), contacts);
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
  if (!question.plan.runsIntersection ||
      !(contacts.facts.startsPiercing() || question.plan.startsIntersecting))
    return;
  if (meshes.step.motion > 0.0)
    forEachPair([&](const ElementPair& pair) { addCrossingsAtStart(meshes, pair, intersections); });
  PALPATE_ASSERT(question.plan.kind == PairKind::Meshes);
  meshes.settings.method = Method::Intersection;
  findContactsByBruteForce(meshes, intersections);
}

void detectVerticesByBruteForce(const Question& question, std::span<const std::uint32_t> vertices,
                                ContactBuffers& contacts) {
  PALPATE_ASSERT(std::is_sorted(vertices.begin(), vertices.end()));
  FeatureLists features;
  features.verticesOfA.assign(vertices.begin(), vertices.end());
  findContactsByBruteForce(question, features, contacts);
}

}  // namespace palpate
