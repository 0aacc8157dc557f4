#include "Contact/FirstImpacts.h"

#include "Core/Stopping.h"

#include <cstddef>
#include <tuple>

namespace palpate {

void FirstImpacts::dropRepeated(bool self, const Impacts& impacts) {
  m_entries.clear();
  impacts.forEach([&](const auto& contact, const ImpactPlace& place) {
    if (m_dropped.isDropped[place]) return;
    if (const auto features = sharedFeatures(SidedImpact(place.kind, contact), self))
      m_entries.push_back({*features, contact.timeOfImpact, place});
  });
  sortInTime(m_entries.begin(), m_entries.end(), [](const Entry& l, const Entry& r) {
    return std::tie(l.features[0], l.features[1], l.time, l.place.kind, l.place.index) <
           std::tie(r.features[0], r.features[1], r.time, r.place.kind, r.place.index);
  });
  TimeCheck check(256);
  std::size_t first = 0;
  for (std::size_t i = 1; i < m_entries.size(); ++i) {
    check();
    const Entry &entry = m_entries[i], &kept = m_entries[first];
    if (entry.features != kept.features) {
      first = i;
      continue;
    }
    m_dropped.sameFeatures[entry.place] = kept.place;
    m_dropped.drop(entry.place, kept.place);
  }
}

void FirstImpacts::keep(const MeshPair& meshes, double end, const OrderScratch& ordered,
                        CollisionData::Contents& contents) {
  m_dropped.isDropped.assign(contents, 0);
  m_dropped.sameFeatures.assign(contents, {});
  m_dropped.standIns.clear();
  const Impacts impacts(contents, end, ordered);
  m_excluded.find(meshes, impacts, m_dropped);
  dropRepeated(meshes.self(), impacts);
  auto& endRows = contents.step.endRows;
  endRows.clear();
  const bool moves = meshes.step.motion > 0.0;
  if (moves) m_endRows.find(meshes, impacts, m_dropped);
  std::uint32_t number = 0;
  TimeCheck check(256);
  forEachMeshList(contents, [&](ContactKind kind, auto& contacts) {
    std::size_t kept = 0;
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      check();
      const ImpactPlace place{kind, i};
      if (m_dropped.isDropped[place]) continue;
      contacts[kept++] = contacts[i];
      if (const EndRows::EndRow* const row = moves ? m_endRows.of(place) : nullptr) {
        endRows.push_back(*row);
        endRows.back().contact = number;
      }
      ++number;
    }
    contacts.resize(kept);
  });
}

}  // namespace palpate
