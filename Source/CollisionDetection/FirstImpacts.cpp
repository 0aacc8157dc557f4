#include "CollisionDetection/FirstImpacts.h"

#include "CollisionDetection/ExcludedImpacts.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <tuple>
#include <type_traits>
#include <utility>

namespace palpate {

namespace {

std::uint64_t featureKey(std::uint32_t p, std::uint32_t q) {
  return std::uint64_t{std::min(p, q)} << 32 | std::max(p, q);
}

std::uint64_t featureKey(const Segment& edge, EdgeFeature feature) {
  const std::uint32_t p = edge[feature == EdgeFeature::End],
                      q = edge[feature != EdgeFeature::Start];
  return featureKey(p, q);
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

}  // namespace

std::optional<ImpactFeatures> sharedFeatures(const VertexTriangleContact& c, bool swapped,
                                             bool self) {
  if (c.feature == TriangleFeature::Face) return {};
  const int i = static_cast<int>(c.feature);
  const std::uint64_t vertex = featureKey(c.vertex, c.vertex),
                      other = i < 3 ? featureKey(c.vertices[i], c.vertices[i])
                                    : featureKey(c.vertices[i - 3], c.vertices[(i - 2) % 3]);
  return inOrder(vertex, other, self ? other < vertex : swapped);
}

std::optional<ImpactFeatures> sharedFeatures(const EdgeEdgeContact& c, bool self) {
  const std::uint64_t a = featureKey(c.edgeA, c.featureA), b = featureKey(c.edgeB, c.featureB);
  if (c.featureA == EdgeFeature::Interior && c.featureB == EdgeFeature::Interior) return {};
  return inOrder(a, b, self && b < a);
}

/// Drops excluded impacts for which others stand. These are looked up by their vertex, or by the
/// first vertex of their line's edge.
void FirstImpacts::dropExcluded(const MeshPair& meshes, double end, const OrderScratch& ordered,
                                const CollisionData::Contents& contents) {
  const ExcludedImpacts rule(meshes);
  if (!rule.mayExclude()) return;
  const std::uint32_t lines = rule.linesAreSecond();  // as the list of their vertices
  const auto numberOf = [&](std::uint32_t list, std::uint32_t vertex) {
    return list == 1 ? meshes.a.now.size() + vertex : vertex;
  };
  const auto placeOf = [&](const auto& contact, std::uint32_t list) {
    if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
      return numberOf(lines, rule.lineEdge(contact)[0]);
    else
      return numberOf(list, contact.vertex);
  };
  TimeCheck check(ordered.deadline, 32);
  std::size_t proper = 0, excluded = 0;
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      if (!isImpact(contacts[i], list, i, end, ordered)) continue;
      check();
      if constexpr (std::is_same_v<decltype(contacts[i]), const EdgeEdgeContact&>)
        m_dropped[list][i] = rule.isExcluded(contacts[i]);
      else
        m_dropped[list][i] = rule.isExcluded(contacts[i], list == 1);
      (m_dropped[list][i] ? excluded : proper) += 1;
    }
  });
  if (excluded == 0) return;
  // A counting sort: m_starts[n + 1] becomes the end of the impacts of vertex n.
  m_starts.assign(meshes.a.now.size() + meshes.b.now.size() + 2, 0);
  m_proper.resize(proper);
  const auto forEachProper = [&](auto&& f) {
    forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
      for (std::uint32_t i = 0; i < contacts.size(); ++i)
        if (!m_dropped[list][i] && isImpact(contacts[i], list, i, end, ordered))
          f(placeOf(contacts[i], list), Place{list, i});
    });
  };
  forEachProper([&](std::size_t n, Place) { ++m_starts[n + 2]; });
  std::partial_sum(m_starts.begin(), m_starts.end(), m_starts.begin());
  forEachProper([&](std::size_t n, Place place) { m_proper[m_starts[n + 1]++] = place; });

  const auto vertexImpact = [&](Place place) -> const VertexTriangleContact& {
    return (place.list == 0 ? contents.vertexTriangle : contents.triangleVertex)[place.index];
  };
  m_planes.clear();
  for (const Place place : m_proper) {
    check();
    m_planes.push_back(place.list == 2 ? rule.planeOf(contents.edgeEdge[place.index])
                                       : rule.planeOf(vertexImpact(place), place.list == 1));
  }

  const auto anyAt = [&](std::size_t n, auto&& f) {
    for (std::uint32_t i = m_starts[n]; i < m_starts[n + 1]; ++i)
      if (f(m_proper[i], m_planes[i])) return true;
    return false;
  };
  // Whether f holds for an impact of the vertex, or of the edge, and its plane.
  const auto anyOfVertex = [&](std::uint32_t list, std::uint32_t vertex, auto&& f) {
    return anyAt(numberOf(list, vertex), [&](Place s, const TangentPlane& plane) {
      return s.list != 2 && f(vertexImpact(s), plane);
    });
  };
  const auto anyOfEdge = [&](const Segment& edge, auto&& f) {
    return anyAt(numberOf(lines, edge[0]), [&](Place s, const TangentPlane& plane) {
      return s.list == 2 && rule.lineEdge(contents.edgeEdge[s.index]) == edge &&
             f(contents.edgeEdge[s.index], plane);
    });
  };
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      if (!m_dropped[list][i]) continue;
      check();
      const auto& c = contacts[i];
      if constexpr (std::is_same_v<decltype(c), const EdgeEdgeContact&>)
        m_dropped[list][i] = rule.isReplaced(c, [&](auto&& f) {
          const Segment& edge = rule.lineEdge(c);
          return anyOfEdge(edge, f) || anyOfVertex(lines, edge[0], f) ||
                 anyOfVertex(lines, edge[1], f);
        });
      else
        m_dropped[list][i] =
            rule.isReplaced(c, list == 1, [&](auto&& f) { return anyOfVertex(list, c.vertex, f); });
    }
  });
}

void FirstImpacts::keep(const MeshPair& meshes, double end, const OrderScratch& ordered,
                        CollisionData::Contents& contents) {
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    PALPATE_ASSERT(ordered.preferred[list].empty() ||
                   ordered.preferred[list].size() == contacts.size());
    m_dropped[list].assign(contacts.size(), 0);
  });
  dropExcluded(meshes, end, ordered, contents);
  m_entries.clear();
  TimeCheck check(ordered.deadline, 256);
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      const auto& contact = contacts[i];
      check();
      if (!isImpact(contact, list, i, end, ordered) || m_dropped[list][i]) continue;
      std::optional<ImpactFeatures> features;
      if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
        features = sharedFeatures(contact, meshes.self());
      else
        features = sharedFeatures(contact, list == 1, meshes.self());
      if (features) m_entries.push_back({*features, contact.timeOfImpact, list, i});
    }
  });
  sortUntil(ordered.deadline, m_entries.begin(), m_entries.end(),
            [](const Entry& l, const Entry& r) {
              return std::tie(l.features[0], l.features[1], l.time, l.list, l.index) <
                     std::tie(r.features[0], r.features[1], r.time, r.list, r.index);
            });
  for (std::size_t i = 1; i < m_entries.size(); ++i) {
    check();
    if (m_entries[i].features == m_entries[i - 1].features)
      m_dropped[m_entries[i].list][m_entries[i].index] = 1;
  }
  forEachImpactList(contents, [&](auto& contacts, std::uint32_t list) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      check();
      if (!m_dropped[list][i]) contacts[kept++] = contacts[i];
    }
    contacts.resize(kept);
  });
}

}  // namespace palpate
