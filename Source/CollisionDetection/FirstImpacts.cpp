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

/// Whether an entry of a list is an impact that another may stand for.
bool isImpact(const auto& contact, std::uint32_t list, std::uint32_t index, double end,
              const OrderScratch& ordered) {
  const Buffer<std::uint8_t>& preferred = ordered.preferred[list];
  return contact.timeOfImpact < end && (preferred.empty() || !preferred[index]);
}

/// Of points and lines: the vertex, or the edge, that an impact is of, as a key.
ImpactFeatures keyOf(std::uint32_t vertex) { return {0, vertex}; }
ImpactFeatures keyOf(const Segment& edge) { return {1, std::uint64_t{edge[0]} << 32 | edge[1]}; }

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

void FirstImpacts::sortEntries() {
  std::sort(m_entries.begin(), m_entries.end(), [](const Entry& l, const Entry& r) {
    return std::tie(l.features, l.time, l.list, l.index) <
           std::tie(r.features, r.time, r.list, r.index);
  });
}

/// Drops excluded impacts for which others stand.
void FirstImpacts::dropExcluded(const MeshPair& meshes, double end, const OrderScratch& ordered,
                                const CollisionData::Contents& contents) {
  const ExcludedImpacts rule(meshes);
  if (!rule.mayExclude()) return;
  m_entries.clear();  // of impacts that are not excluded
  bool any = false;
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      const auto& contact = contacts[i];
      if (!isImpact(contact, list, i, end, ordered)) continue;
      bool excluded;
      ImpactFeatures key;
      if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
        excluded = rule.isExcluded(contact), key = keyOf(rule.lineEdge(contact));
      else
        excluded = rule.isExcluded(contact, list == 1), key = keyOf(contact.vertex);
      any |= excluded;
      m_dropped[list][i] = excluded;
      if (!excluded) m_entries.push_back({key, contact.timeOfImpact, list, i});
    }
  });
  if (!any) return;
  sortEntries();
  const auto anyOf = [&](const ImpactFeatures& key, auto&& f) {
    auto at =
        std::lower_bound(m_entries.begin(), m_entries.end(), key,
                         [](const Entry& e, const ImpactFeatures& k) { return e.features < k; });
    for (; at != m_entries.end() && at->features == key; ++at)
      if (f(*at)) return true;
    return false;
  };
  const auto ofVertex = [&](const Entry& entry) -> const VertexTriangleContact& {
    return (entry.list == 0 ? contents.vertexTriangle : contents.triangleVertex)[entry.index];
  };
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      if (!m_dropped[list][i]) continue;
      const auto& c = contacts[i];
      if constexpr (std::is_same_v<decltype(c), const EdgeEdgeContact&>)
        m_dropped[list][i] = rule.isReplaced(c, [&](auto&& f) {
          const auto isTrueFor = [&](const Entry& entry) { return f(ofVertex(entry)); };
          const Segment& edge = rule.lineEdge(c);
          return anyOf(keyOf(edge),
                       [&](const Entry& entry) { return f(contents.edgeEdge[entry.index]); }) ||
                 anyOf(keyOf(edge[0]), isTrueFor) || anyOf(keyOf(edge[1]), isTrueFor);
        });
      else
        m_dropped[list][i] = rule.isReplaced(c, list == 1, [&](auto&& f) {
          return anyOf(keyOf(c.vertex), [&](const Entry& entry) { return f(ofVertex(entry)); });
        });
    }
  });
}

void FirstImpacts::keep(const MeshPair& meshes, double end, const OrderScratch& ordered,
                        CollisionData::Contents& contents) {
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    m_dropped[list].assign(contacts.size(), 0);
  });
  dropExcluded(meshes, end, ordered, contents);
  m_entries.clear();
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      const auto& contact = contacts[i];
      if (!isImpact(contact, list, i, end, ordered) || m_dropped[list][i]) continue;
      std::optional<ImpactFeatures> features;
      if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
        features = sharedFeatures(contact, meshes.self());
      else
        features = sharedFeatures(contact, list == 1, meshes.self());
      if (features) m_entries.push_back({*features, contact.timeOfImpact, list, i});
    }
  });
  sortEntries();
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
