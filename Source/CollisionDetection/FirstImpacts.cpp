#include "CollisionDetection/FirstImpacts.h"

#include "CollisionDetection/ExcludedImpacts.h"

#include <algorithm>
#include <tuple>
#include <type_traits>
#include <utility>

namespace palpate {

namespace {

std::uint64_t featureOf(std::uint32_t p, std::uint32_t q) {
  return std::uint64_t{std::min(p, q)} << 32 | std::max(p, q);
}

std::uint64_t featureOf(const Segment& edge, EdgeFeature feature) {
  const std::uint32_t p = edge[feature == EdgeFeature::End],
                      q = edge[feature != EdgeFeature::Start];
  return featureOf(p, q);
}

ImpactFeatures inOrder(std::uint64_t first, std::uint64_t second, bool swap) {
  return swap ? ImpactFeatures{second, first} : ImpactFeatures{first, second};
}

/// The contact whose key, which ascends, is the given one.
template <class Contact, class Key, class KeyOf>
const Contact* find(const CountedVector<Contact>& contacts, const Key& key, KeyOf&& keyOf) {
  const auto place = std::lower_bound(contacts.begin(), contacts.end(), key,
                                      [&](const Contact& c, const Key& k) { return keyOf(c) < k; });
  return place != contacts.end() && keyOf(*place) == key ? &*place : nullptr;
}

/// Finds impacts in sorted contents.
struct ListedImpacts {
  const CollisionData::Contents& contents;
  const VertexTriangleContact* ofVertex(std::uint32_t vertex, std::uint32_t triangle,
                                        bool swapped) const {
    if (swapped)
      return find(contents.triangleVertex, std::pair(triangle, vertex),
                  [](const auto& c) { return std::pair(c.triangle, c.vertex); });
    return find(contents.vertexTriangle, std::pair(vertex, triangle),
                [](const auto& c) { return std::pair(c.vertex, c.triangle); });
  }
  const EdgeEdgeContact* ofEdges(const Segment& a, const Segment& b) const {
    return find(contents.edgeEdge, std::pair(a, b),
                [](const auto& c) { return std::pair(c.edgeA, c.edgeB); });
  }
};

}  // namespace

std::optional<ImpactFeatures> sharedFeatures(const VertexTriangleContact& c, bool swapped,
                                             bool self) {
  if (c.feature == TriangleFeature::Face) return {};
  const int i = static_cast<int>(c.feature);
  const std::uint64_t vertex = featureOf(c.vertex, c.vertex),
                      other = i < 3 ? featureOf(c.corners[i], c.corners[i])
                                    : featureOf(c.corners[i - 3], c.corners[(i - 2) % 3]);
  return inOrder(vertex, other, self ? other < vertex : swapped);
}

std::optional<ImpactFeatures> sharedFeatures(const EdgeEdgeContact& c, bool self) {
  const std::uint64_t a = featureOf(c.edgeA, c.featureA), b = featureOf(c.edgeB, c.featureB);
  if (c.featureA == EdgeFeature::Interior && c.featureB == EdgeFeature::Interior) return {};
  return inOrder(a, b, self && b < a);
}

void FirstImpacts::keep(const MeshPair& meshes, double end, const OrderScratch& ordered,
                        CollisionData::Contents& contents) {
  m_entries.clear();
  const ListedImpacts listed{contents};
  const ExcludedImpacts excluded(meshes, listed);
  const bool mayExclude = mayExcludeImpacts(meshes);
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    const Buffer<std::uint8_t>& preferred = ordered.preferred[list];
    m_dropped[list].assign(contacts.size(), 0);
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      const auto& contact = contacts[i];
      if (!(contact.timeOfImpact < end) || (!preferred.empty() && preferred[i])) continue;
      std::optional<ImpactFeatures> features;
      if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>) {
        m_dropped[list][i] = mayExclude && excluded.contain(contact);
        features = sharedFeatures(contact, meshes.self());
      } else {
        m_dropped[list][i] = mayExclude && excluded.contain(contact, list == 1);
        features = sharedFeatures(contact, list == 1, meshes.self());
      }
      if (features && !m_dropped[list][i])
        m_entries.push_back({*features, contact.timeOfImpact, list, i});
    }
  });
  std::sort(m_entries.begin(), m_entries.end(), [](const Entry& l, const Entry& r) {
    return std::tie(l.features, l.time, l.list, l.index) <
           std::tie(r.features, r.time, r.list, r.index);
  });
  for (std::size_t i = 1; i < m_entries.size(); ++i)
    if (m_entries[i].features == m_entries[i - 1].features)
      m_dropped[m_entries[i].list][m_entries[i].index] = 1;
  forEachImpactList(contents, [&](auto& contacts, std::uint32_t list) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < contacts.size(); ++i)
      if (!m_dropped[list][i]) contacts[kept++] = contacts[i];
    contacts.resize(kept);
  });
}

}  // namespace palpate
