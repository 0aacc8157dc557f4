#include "Search/FirstImpacts.h"

#include "Search/ExcludedImpacts.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Proximity.h"
#include "Math/ClosestPoint.h"
#include "Math/MeetingAfter.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <bit>
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

constexpr std::uint32_t kNoRow = 0xffffffffu, kNoPlane = 0xffffffffu;
/// Of a vertex: whether it may have met the other mesh.
enum : std::uint8_t { kUnknown, kAsked, kMet };

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

/// Drops excluded impacts for which others stand. These are looked up by the first vertex and the
/// size of the element that they hold.
void FirstImpacts::dropExcluded(const MeshPair& meshes, double end, const OrderScratch& ordered,
                                const CollisionData::Contents& contents) {
  const ExcludedImpacts rule(meshes);
  const auto sided = [&](std::uint32_t list, std::uint32_t index) {
    if (list == 2) return sidedOf(contents.edgeEdge[index], list);
    return sidedOf((list == 0 ? contents.vertexTriangle : contents.triangleVertex)[index], list);
  };
  TimeCheck check(32);
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
  std::size_t stay = 0;
  forEachImpact([&](std::uint32_t list, std::uint32_t i) { stay += !m_dropped[list][i]; });
  // A mesh with itself has each of its elements on both sides.
  const std::size_t buckets = std::bit_ceil(stay + 1);
  const auto bucketOf = [&](std::size_t side, std::uint32_t vertex) {
    return (side == 1 && !meshes.self() ? vertex + buckets / 2 : vertex) & (buckets - 1);
  };
  const auto forEachHolder = [&](auto&& f) {
    forEachImpact([&](std::uint32_t list, std::uint32_t i) {
      if (m_dropped[list][i]) return;
      const SidedImpact impact = sided(list, i);
      rule.anyHeldSide(impact, [&](std::size_t side) {
        const ImpactElement& element = impact.elements[side];
        f(3 * bucketOf(side, element.ids[0]) + element.size - 1,
          Holder{list, i, static_cast<std::uint32_t>(side), impact.isOfFace, impact.time,
                 impact.distance, element, kNoPlane});
        return false;
      });
    });
  };
  // A counting sort: m_starts[n + 1] becomes the end of the holders with key n.
  m_starts.assign(3 * buckets + 2, 0);
  std::size_t holders = 0;
  forEachHolder([&](std::size_t n, const Holder&) {
    ++m_starts[n + 2];
    ++holders;
  });
  std::partial_sum(m_starts.begin(), m_starts.end(), m_starts.begin());
  m_holders.resize(holders);
  forEachHolder(
      [&](std::size_t n, const Holder& holder) { m_holders[m_starts[n + 1]++] = holder; });
  m_planes.clear();
  const auto planeOf = [&](Holder& holder) {
    if (holder.plane == kNoPlane) {
      holder.plane = static_cast<std::uint32_t>(m_planes.size());
      m_planes.push_back(rule.planeOf(sided(holder.list, holder.index), holder.side));
    }
    return m_planes[holder.plane];
  };
  // Calls f(holder) for the holders of parts of an impact's element that `isAsked`, until it
  // returns true. Begins at the closest vertex: an impact of it mostly stands for this one.
  const auto anyHolder = [&](const SidedImpact& c, std::size_t side, auto&& isAsked, auto&& f) {
    const ImpactElement& element = c.elements[side];
    const auto anyAt = [&](std::uint32_t vertex) {
      const std::size_t n = 3 * bucketOf(side, vertex);
      for (std::uint32_t i = m_starts[n]; i < m_starts[n + element.size]; ++i) {
        Holder& holder = m_holders[i];
        if (holder.element.ids[0] == vertex && (meshes.self() || holder.side == side) &&
            isAsked(holder) && holder.element.isIn(element) && f(holder))
          return true;
      }
      return false;
    };
    const std::uint32_t first = c.closest[side].ids[0];
    if (anyAt(first)) return true;
    const auto vertices = element.vertices();
    return std::any_of(vertices.begin(), vertices.end(),
                       [&](std::uint32_t vertex) { return vertex != first && anyAt(vertex); });
  };
  forEachImpact([&](std::uint32_t list, std::uint32_t i) {
    if (!m_dropped[list][i]) return;
    const SidedImpact c = sided(list, i);
    m_dropped[list][i] = 0;
    rule.anyHeldSide(c, [&](std::size_t side) {
      ExcludedImpacts::Held held(rule, c, side);
      const auto lowestGap = [&](const TangentPlane& plane) {
        double gap = plane.gap;
        const auto isLower = [&](Holder& other) {
          const TangentPlane its = planeOf(other);
          if (its.gap < gap && plane.isSameAs(its)) gap = its.gap;
          return false;
        };
        anyHolder(
            c, side, [](const Holder&) { return true; }, isLower);
        return gap;
      };
      const auto isInTime = [&](const Holder& holder) {
        return rule.isInTime(holder.isOfFace, holder.time, holder.distance, c);
      };
      const auto stands = [&](Holder& holder) {
        const TangentPlane plane = planeOf(holder);
        if (!held.isBeside(plane) || !held.isReplacedBy(holder.element, plane, lowestGap))
          return false;
        m_dropped[list][i] = 1;
        m_standIns.push_back({{list, i}, {holder.list, holder.index}});
        return true;
      };
      return anyHolder(c, side, isInTime, stands) &&
             c.vertexSide < 2;  // of two edges, both are held
    });
  });
}

namespace {

/// The contact of an impact's features at the step's end.
VertexTriangleContact atEnd(const MeshPair& meshes, const VertexTriangleContact& c, bool swapped) {
  const Positions &own = (swapped ? meshes.b : meshes.a).now,
                  &other = (swapped ? meshes.a : meshes.b).now;
  const auto& [p, q, r] = c.vertices;
  return contactOf(c.vertex, c.triangle, c.vertices,
                   finiteVertexTriangleDistance(own[c.vertex], other[p], other[q], other[r]));
}
EdgeEdgeContact atEnd(const MeshPair& meshes, const EdgeEdgeContact& c, bool) {
  const Positions &a = meshes.a.now, &b = meshes.b.now;
  return contactOf(
      c.edgeA, c.edgeB,
      finiteEdgeEdgeDistance(a[c.edgeA[0]], a[c.edgeA[1]], b[c.edgeB[0]], b[c.edgeB[1]]));
}

ImpactQuery queryOf(const MeshPair& meshes, const VertexTriangleContact& c, bool swapped) {
  const Features<ImpactQuery::Kind::VertexTriangle> features{swapped ? meshes.b : meshes.a,
                                                             swapped ? meshes.a : meshes.b};
  return features.query(c.vertex, c.triangle);
}
ImpactQuery queryOf(const MeshPair& meshes, const EdgeEdgeContact& c, bool) {
  const auto step = [](const TriangleMesh& mesh, std::uint32_t v) {
    return ImpactQuery::Step{mesh.before[v], mesh.now[v]};
  };
  const auto& [p, q] = c.edgeA;
  const auto& [r, s] = c.edgeB;
  return {ImpactQuery::Kind::EdgeEdge,
          {step(meshes.a, p), step(meshes.a, q), step(meshes.b, r), step(meshes.b, s)}};
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

/// Whether an impact's features may meet in the rest of the step.
template <class Contact>
bool mayMeet(const MeshPair& meshes, const Contact& c, bool swapped) {
  const double radii = meshes.a.largestRadius + meshes.b.largestRadius;
  return mayMeetAfter(queryOf(meshes, c, swapped), c.timeOfImpact, c.normal, c.distance + radii,
                      radii);
}

}  // namespace

void FirstImpacts::findEndRows(const MeshPair& meshes, double end, const OrderScratch& ordered,
                               const CollisionData::Contents& contents) {
  const double radii = meshes.a.largestRadius + meshes.b.largestRadius;
  TimeCheck check(64);
  // Calls f(state) for the vertices of an impact, and returns whether any call did.
  const auto anyVertex = [&](const auto& c, std::uint32_t list, auto&& f) {
    const bool swapped = list == 1;
    bool any = false;
    const auto visit = [&](bool ofB, const auto& vertices) {
      for (const std::uint32_t v : vertices) any |= f(m_met[ofB && !meshes.self()][v]);
    };
    if constexpr (requires { c.vertex; }) {
      visit(swapped, std::array{c.vertex});
      visit(!swapped, c.vertices);
    } else {
      visit(false, c.edgeA);
      visit(true, c.edgeB);
    }
    return any;
  };
  const std::array<std::size_t, 2> sizes{meshes.a.now.size(), meshes.b.now.size()};
  for (std::size_t side = 0; side < 2; ++side)
    if (m_isMarked)  // a deadline ended the last call
      m_met[side].assign(sizes[side], kUnknown);
    else if (m_met[side].size() < sizes[side])
      m_met[side].resize(sizes[side], kUnknown);
  m_isMarked = true;
  m_candidates.clear();
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    m_endRowOf[list].assign(contacts.size(), kNoRow);
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      const auto& c = contacts[i];
      if (m_dropped[list][i] || !isImpact(c, list, i, end, ordered)) continue;
      check();
      const double gap = atEnd(meshes, c, list == 1).distance - radii;
      if (!meshes.settings.smoothNormals &&
          !(c.distance + separationUntilEnd(meshes, c, list == 1) < gap))
        continue;
      if (mayMeet(meshes, c, list == 1)) continue;
      m_candidates.push_back({{list, i}, gap});
      anyVertex(c, list, [](std::uint8_t& met) { return met = kAsked; });
    }
  });
  m_endRows.clear();
  m_nearest.clear();
  m_listOfRows.clear();
  m_isMarked = !m_candidates.empty();
  if (!m_isMarked) return;
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    for (std::uint32_t i = 0; i < contacts.size(); ++i) {
      const auto& c = contacts[i];
      if (!isImpact(c, list, i, end, ordered)) continue;
      check();
      if (anyVertex(c, list, [](std::uint8_t met) { return met == kAsked; }) &&
          mayMeet(meshes, c, list == 1))
        anyVertex(c, list, [](std::uint8_t& met) {
          if (met == kAsked) met = kMet;
          return false;
        });
    }
  });
  const auto withContact = [&](const Place& place, auto&& f) {
    forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
      if (list == place.list) f(contacts[place.index], list);
    });
  };
  for (const Candidate& candidate : m_candidates)
    withContact(candidate.place, [&](const auto& c, std::uint32_t list) {
      if (anyVertex(c, list, [](std::uint8_t met) { return met == kMet; })) return;
      m_endRowOf[list][candidate.place.index] = static_cast<std::uint32_t>(m_endRows.size());
      m_endRows.push_back({0, stencil(c), c.normal, candidate.gap});
      m_listOfRows.push_back(list);
      m_nearest.push_back(candidate.place);
    });
  for (const Candidate& candidate : m_candidates)
    withContact(candidate.place, [&](const auto& c, std::uint32_t list) {
      anyVertex(c, list, [](std::uint8_t& met) { return met = kUnknown; });
    });
  m_isMarked = false;
  if (m_endRows.empty()) return;
  for (const StandIn& each : m_standIns) {
    check();
    const Place &dropped = each.dropped, &standIn = each.kept;
    // An impact that stands for others is dropped only for another one with its features.
    const Place kept = m_dropped[standIn.list][standIn.index]
                           ? m_sameFeatures[standIn.list][standIn.index]
                           : standIn;
    PALPATE_ASSERT(!m_dropped[kept.list][kept.index]);
    const std::uint32_t row = m_endRowOf[kept.list][kept.index];
    if (row == kNoRow) continue;
    withContact(dropped, [&](const auto& c, std::uint32_t list) {
      const double gap = atEnd(meshes, c, list == 1).distance - radii;
      if (!(gap < m_endRows[row].gap)) return;
      m_endRows[row].gap = gap;
      m_nearest[row] = dropped;
    });
  }
  const ExcludedImpacts rule(meshes);
  for (std::size_t row = 0; row < m_endRows.size(); ++row) {
    check();
    withContact(m_nearest[row], [&](const auto& impact, std::uint32_t list) {
      Stencil& own = m_endRows[row].stencil;
      const auto c = atEnd(meshes, impact, list == 1);
      const Stencil its = stencil(c);
      const bool isOfSame =
          list == m_listOfRows[row] &&
          (list < 2 ? its.vertices[0] == own.vertices[0] : its.vertices == own.vertices);
      if (!isOfSame || rule.isExcluded(sidedOf(c, list))) return;
      own = its;
      m_endRows[row].normal = c.normal;
    });
  }
}

void FirstImpacts::keep(const MeshPair& meshes, double end, const OrderScratch& ordered,
                        CollisionData::Contents& contents) {
  forEachImpactList(contents, [&](const auto& contacts, std::uint32_t list) {
    PALPATE_ASSERT(ordered.preferred[list].empty() ||
                   ordered.preferred[list].size() == contacts.size());
    m_dropped[list].assign(contacts.size(), 0);
    m_sameFeatures[list].resize(contacts.size());
  });
  m_standIns.clear();
  dropExcluded(meshes, end, ordered, contents);
  m_entries.clear();
  TimeCheck check(256);
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
  sortInTime(m_entries.begin(), m_entries.end(), [](const Entry& l, const Entry& r) {
    return std::tie(l.features[0], l.features[1], l.time, l.list, l.index) <
           std::tie(r.features[0], r.features[1], r.time, r.list, r.index);
  });
  Place first{};
  if (!m_entries.empty()) first = {m_entries[0].list, m_entries[0].index};
  for (std::size_t i = 1; i < m_entries.size(); ++i) {
    check();
    const Entry& entry = m_entries[i];
    if (entry.features != m_entries[i - 1].features) {
      first = {entry.list, entry.index};
      continue;
    }
    m_dropped[entry.list][entry.index] = 1;
    m_sameFeatures[entry.list][entry.index] = first;
    m_standIns.push_back({{entry.list, entry.index}, first});
  }
  auto& endRows = contents.step.endRows;
  endRows.clear();
  const bool moves = meshes.step.motion > 0.0;
  if (moves) findEndRows(meshes, end, ordered, contents);
  std::uint32_t number = 0;
  forEachImpactList(contents, [&](auto& contacts, std::uint32_t list) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      check();
      if (m_dropped[list][i]) continue;
      contacts[kept++] = contacts[i];
      if (moves && m_endRowOf[list][i] != kNoRow) {
        endRows.push_back(m_endRows[m_endRowOf[list][i]]);
        endRows.back().contact = number;
      }
      ++number;
    }
    contacts.resize(kept);
  });
}

}  // namespace palpate
