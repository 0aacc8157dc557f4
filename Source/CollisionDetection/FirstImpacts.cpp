#include "CollisionDetection/FirstImpacts.h"

#include "CollisionDetection/ExcludedImpacts.h"
#include "Math/ClosestPoint.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cstddef>
#include <limits>
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

SidedImpact sidedOf(const VertexTriangleContact& c, std::uint32_t list) { return {c, list == 1}; }
SidedImpact sidedOf(const EdgeEdgeContact& c, std::uint32_t) { return SidedImpact(c); }

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

/// Drops excluded impacts for which others stand. These are looked up by the first vertex of the
/// element that they hold.
void FirstImpacts::dropExcluded(const MeshPair& meshes, double end, const OrderScratch& ordered,
                                const CollisionData::Contents& contents) {
  const ExcludedImpacts rule(meshes);
  const auto sided = [&](std::uint32_t list, std::uint32_t index) {
    if (list == 2) return sidedOf(contents.edgeEdge[index], list);
    return sidedOf((list == 0 ? contents.vertexTriangle : contents.triangleVertex)[index], list);
  };
  TimeCheck check(ordered.deadline, 32);
  const auto forEachImpact = [&](auto&& f) {
    forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
      for (std::uint32_t i = 0; i < contacts.size(); ++i)
        if (isImpact(contacts[i], list, i, end, ordered)) {
          check();
          f(list, i);
        }
    });
  };
  std::size_t excluded = 0;
  forEachImpact([&](std::uint32_t list, std::uint32_t i) {
    excluded += m_dropped[list][i] = rule.isExcluded(sided(list, i));
  });
  if (excluded == 0) return;
  // A mesh with itself has each of its elements on both sides.
  const auto numberOf = [&](std::size_t side, std::uint32_t vertex) {
    return side == 1 && !meshes.self() ? meshes.a.now.size() + vertex : vertex;
  };
  const auto forEachHolder = [&](auto&& f) {
    forEachImpact([&](std::uint32_t list, std::uint32_t i) {
      if (m_dropped[list][i]) return;
      const SidedImpact impact = sided(list, i);
      rule.anyHeldSide(impact, [&](std::size_t side) {
        f(numberOf(side, impact.elements[side].ids[0]), impact, Holder{list, i, side});
        return false;
      });
    });
  };
  // A counting sort: m_starts[n + 1] becomes the end of the holders at vertex n.
  m_starts.assign(meshes.a.now.size() + meshes.b.now.size() + 2, 0);
  std::size_t holders = 0;
  forEachHolder([&](std::size_t n, const SidedImpact&, const Holder&) {
    ++m_starts[n + 2];
    ++holders;
  });
  std::partial_sum(m_starts.begin(), m_starts.end(), m_starts.begin());
  m_holders.resize(holders);
  forEachHolder([&](std::size_t n, const SidedImpact&, const Holder& holder) {
    m_holders[m_starts[n + 1]++] = holder;
  });
  m_planes.clear();
  for (const Holder& holder : m_holders) {
    check();
    m_planes.push_back(rule.planeOf(sided(holder.list, holder.index), holder.side));
  }
  // Calls f(number) for the holders of parts of an impact's element, until it returns true. Begins
  // at the closest vertex: an impact of it mostly stands for this one.
  const auto anyHolder = [&](const SidedImpact& c, std::size_t side, auto&& f) {
    const auto anyAt = [&](std::uint32_t vertex) {
      const std::size_t n = numberOf(side, vertex);
      for (std::uint32_t i = m_starts[n]; i < m_starts[n + 1]; ++i)
        if (f(i)) return true;
      return false;
    };
    const std::uint32_t first = c.closest[side].ids[0];
    if (anyAt(first)) return true;
    const auto vertices = c.elements[side].vertices();
    return std::any_of(vertices.begin(), vertices.end(),
                       [&](std::uint32_t vertex) { return vertex != first && anyAt(vertex); });
  };
  forEachImpact([&](std::uint32_t list, std::uint32_t i) {
    if (!m_dropped[list][i]) return;
    const SidedImpact c = sided(list, i);
    m_dropped[list][i] = 0;
    rule.anyHeldSide(c, [&](std::size_t side) {
      ExcludedImpacts::Held held(rule, c, side);
      const auto impactOf = [&](std::uint32_t number) {
        return sided(m_holders[number].list, m_holders[number].index);
      };
      const auto lowestGap = [&](const TangentPlane& plane) {
        double gap = plane.gap;
        anyHolder(c, side, [&](std::uint32_t other) {
          const TangentPlane& its = m_planes[other];
          if (its.gap < gap && plane.isSameAs(its) &&
              impactOf(other).elements[m_holders[other].side].isIn(held.element()))
            gap = its.gap;
          return false;
        });
        return gap;
      };
      return anyHolder(c, side, [&](std::uint32_t number) {
        const Holder& holder = m_holders[number];
        if (!held.isBeside(m_planes[number]) ||
            !held.isReplacedBy(impactOf(number), holder.side, m_planes[number], lowestGap))
          return false;
        drop({list, i}, {holder.list, holder.index});
        return true;
      });
    });
  });
}

void FirstImpacts::drop(Place dropped, Place standIn) {
  m_dropped[dropped.list][dropped.index] = 1;
  m_standIns[dropped.list][dropped.index] = standIn;
}

namespace {

double distanceAtEnd(const MeshPair& meshes, const VertexTriangleContact& c, bool swapped) {
  const Positions &own = (swapped ? meshes.b : meshes.a).now,
                  &other = (swapped ? meshes.a : meshes.b).now;
  const auto& [p, q, r] = c.vertices;
  return finiteVertexTriangleDistance(own[c.vertex], other[p], other[q], other[r]).distance;
}
double distanceAtEnd(const MeshPair& meshes, const EdgeEdgeContact& c, bool) {
  const Positions &a = meshes.a.now, &b = meshes.b.now;
  return finiteEdgeEdgeDistance(a[c.edgeA[0]], a[c.edgeA[1]], b[c.edgeB[0]], b[c.edgeB[1]])
      .distance;
}

/// How far the closest points move apart along the normal until the step's end.
template <class Contact>
double separationUntilEnd(const MeshPair& meshes, const Contact& c, bool swapped) {
  const Stencil s = stencil(c);
  constexpr std::size_t kFirst = std::is_same_v<Contact, EdgeEdgeContact> ? 2 : 1;
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const TriangleMesh& mesh = (i < kFirst) != swapped ? meshes.a : meshes.b;
    moved += s.weights[i] * (mesh.now[s.vertices[i]] - mesh.before[s.vertices[i]]);
  }
  return (1.0 - c.timeOfImpact) * c.normal.dot(moved);
}

}  // namespace

/// Gaps of -infinity say nothing: those of contacts at the end, of features that may meet, and of
/// impacts whose row asks for no more than their own features.
void FirstImpacts::findEndGaps(const MeshPair& meshes, double end, const MetVertices& met,
                               const OrderScratch& ordered,
                               const CollisionData::Contents& contents) {
  constexpr double kNothing = -std::numeric_limits<double>::infinity();
  const double radii = meshes.a.largestRadius + meshes.b.largestRadius;
  TimeCheck check(ordered.deadline, 64);
  const auto mayMeet = [&](const SidedImpact& impact) {
    for (std::size_t side = 0; side < 2; ++side)
      for (const std::uint32_t v : impact.elements[side].vertices())
        if (std::binary_search(met[side].begin(), met[side].end(), v)) return true;
    return false;
  };
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    m_endGaps[list].assign(contacts.size(), kNothing);
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      const auto& c = contacts[i];
      if (m_dropped[list][i] || !isImpact(c, list, i, end, ordered)) continue;
      check();
      if (mayMeet(sidedOf(c, list))) continue;
      const double gap = distanceAtEnd(meshes, c, list == 1) - radii;
      if (meshes.settings.smoothNormals ||
          c.distance + separationUntilEnd(meshes, c, list == 1) < gap)
        m_endGaps[list][i] = gap;
    }
  });
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      if (!m_dropped[list][i]) continue;
      check();
      Place kept{list, i};
      while (m_dropped[kept.list][kept.index]) kept = m_standIns[kept.list][kept.index];
      double& gap = m_endGaps[kept.list][kept.index];
      if (gap != kNothing)
        gap = std::min(gap, distanceAtEnd(meshes, contacts[i], list == 1) - radii);
    }
  });
}

void FirstImpacts::keep(const MeshPair& meshes, double end, const MetVertices& met,
                        const OrderScratch& ordered, CollisionData::Contents& contents) {
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    PALPATE_ASSERT(ordered.preferred[list].empty() ||
                   ordered.preferred[list].size() == contacts.size());
    m_dropped[list].assign(contacts.size(), 0);
    m_standIns[list].resize(contacts.size());
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
    const Entry &entry = m_entries[i], &last = m_entries[i - 1];
    if (entry.features == last.features) drop({entry.list, entry.index}, {last.list, last.index});
  }
  CountedVector<double>& endGaps = contents.step.endGaps;
  endGaps.clear();
  const bool moves = meshes.step.motion > 0.0;
  if (moves) findEndGaps(meshes, end, met, ordered, contents);
  forEachImpactList(contents, [&](auto& contacts, std::uint32_t list) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      check();
      if (m_dropped[list][i]) continue;
      contacts[kept++] = contacts[i];
      if (moves) endGaps.push_back(m_endGaps[list][i]);
    }
    contacts.resize(kept);
  });
}

}  // namespace palpate
