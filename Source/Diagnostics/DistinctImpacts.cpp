#include "Diagnostics/DistinctImpacts.h"

#include "Search/ExcludedImpacts.h"
#include "Search/FirstImpacts.h"
#include "NarrowPhase/Continuous.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <tuple>
#include <type_traits>
#include <vector>

namespace palpate {

namespace {

bool keepsDistinctImpacts(const MeshPair& meshes) {
  return meshes.reportsDistinct() &&
         (meshes.settings.method == Method::Continuous || meshes.step.reportsImpacts);
}

/// Contacts with this time or a later one are those of the step's end.
double endOfImpacts(const MeshPair& meshes) {
  return meshes.settings.method == Method::Continuous ? std::numeric_limits<double>::infinity()
                                                      : 1.0;
}

/// Contacts::Distinct for impacts: drops excluded impacts for which others stand. Computes all
/// impacts of the elements that may be held.
class ExcludedByBruteForce {
 public:
  explicit ExcludedByBruteForce(const MeshPair& meshes) : m_meshes(meshes), m_rule(meshes) {}

  bool isDropped(const SidedImpact& c) {
    return m_rule.isExcluded(c) && m_rule.anyHeldSide(c, [&](std::size_t side) {
      const std::vector<Holder> holders = holdersOf(c.elements[side], side);
      const auto planeOf = [&](const Holder& holder) {
        return m_rule.planeOf(holder.impact, holder.side);
      };
      const auto lowestGap = [&](const TangentPlane& plane) {
        double gap = plane.gap;
        for (const Holder& holder : holders)
          if (plane.isSameAs(planeOf(holder))) gap = std::min(gap, planeOf(holder).gap);
        return gap;
      };
      ExcludedImpacts::Held held(m_rule, c, side);
      return std::any_of(holders.begin(), holders.end(), [&](const Holder& s) {
        return m_rule.isInTime(s.impact.isOfFace, s.impact.time, s.impact.distance, c) &&
               held.isBeside(planeOf(s)) &&
               held.isReplacedBy(s.impact.elements[s.side], planeOf(s), lowestGap);
      });
    });
  }

 private:
  struct Holder {
    SidedImpact impact;
    std::size_t side;
  };

  /// All impacts that are not excluded and hold the element or a part of it.
  std::vector<Holder> holdersOf(const ImpactElement& held, std::size_t side) {
    m_found.clear();
    const MeshTopology& topology = (side == 0 ? m_meshes.a : m_meshes.b).topology;
    for (const std::uint32_t vertex : held.vertices()) addOfVertex(vertex, side);
    for (std::size_t i = 0; i < held.size; ++i)
      for (std::size_t j = 0; j < held.size; ++j)
        if (held.ids[i] < held.ids[j])
          if (const auto e = topology.edgeOf({held.ids[i], held.ids[j]}); e != kNoEdge)
            addOfEdge(e, side);
    if (held.size == 3)
      for (const std::uint32_t t : topology.vertexTriangles[held.ids[0]])
        if (ImpactElement(topology.elements[t]).isIn(held)) addOfTriangle(t, side);
    std::vector<Holder> holders;
    const auto add = [&](const SidedImpact& impact) {
      if (m_rule.isExcluded(impact)) return;
      m_rule.anyHeldSide(impact, [&](std::size_t own) {
        if ((own == side || m_meshes.self()) && impact.elements[own].isIn(held))
          holders.push_back({impact, own});
        return false;
      });
    };
    for (const auto& c : m_found.vertexTriangle) add(SidedImpact(c, false));
    for (const auto& c : m_found.triangleVertex) add(SidedImpact(c, true));
    for (const auto& c : m_found.edgeEdge) add(SidedImpact(c));
    return holders;
  }
  void addOfVertex(std::uint32_t vertex, std::size_t side) {
    const MeshTopology& others = (side == 0 ? m_meshes.b : m_meshes.a).topology;
    for (std::uint32_t t = 0; t < others.elements.size(); ++t)
      if (others.isEnabled(t)) add(vertex, t, side == 1 && !m_meshes.self());
  }
  void addOfTriangle(std::uint32_t triangle, std::size_t side) {
    const MeshTopology& others = (side == 0 ? m_meshes.b : m_meshes.a).topology;
    for (std::uint32_t v = 0; v < others.vertexCount; ++v)
      if (!others.vertexTriangles[v].empty()) add(v, triangle, side == 0 && !m_meshes.self());
  }
  void addOfEdge(std::uint32_t edge, std::size_t side) {
    const Features<ImpactQuery::Kind::EdgeEdge> features{m_meshes.a, m_meshes.b};
    const MeshTopology& others = (side == 0 ? m_meshes.b : m_meshes.a).topology;
    for (std::uint32_t other = 0; other < others.edges.size(); ++other) {
      if (others.edgeTriangles[other].empty() || m_meshes.excludesEdges(edge, other)) continue;
      const bool swap = m_meshes.self() ? others.precedes(other, edge) : side == 1;
      addImpact(m_meshes, features, swap ? other : edge, swap ? edge : other, false, m_found);
    }
  }
  /// swapped: the vertex is of MeshPair::b.
  void add(std::uint32_t vertex, std::uint32_t triangle, bool swapped) {
    const TriangleMesh &own = swapped ? m_meshes.b : m_meshes.a,
                       &others = swapped ? m_meshes.a : m_meshes.b;
    if (!areTested(own.topology, others.topology, !swapped) ||
        m_meshes.excludesVertex(vertex, triangle))
      return;
    addImpact(m_meshes, Features<ImpactQuery::Kind::VertexTriangle>{own, others}, vertex, triangle,
              swapped, m_found);
  }

  const MeshPair& m_meshes;
  const ExcludedImpacts m_rule;
  ContactBuffers m_found;
};

SidedImpact sided(const VertexTriangleContact& c, int list) { return {c, list == 1}; }
SidedImpact sided(const EdgeEdgeContact& c, int) { return SidedImpact(c); }

}  // namespace

void dropExcludedImpacts(const MeshPair& meshes, CollisionData::Contents& expected) {
  if (!keepsDistinctImpacts(meshes)) return;
  const double end = endOfImpacts(meshes);
  ExcludedByBruteForce excluded(meshes);
  forEachImpactList(expected, [&](auto& contacts, int list) {
    std::erase_if(contacts, [&](const auto& contact) {
      return contact.timeOfImpact < end && excluded.isDropped(sided(contact, list));
    });
  });
}

void dropRepeatedImpacts(const MeshPair& meshes, const CollisionData& answer,
                         CollisionData::Contents& expected) {
  if (!keepsDistinctImpacts(meshes)) return;
  const double end = endOfImpacts(meshes);
  using Rank = std::tuple<double, int, std::array<std::uint32_t, 4>>;
  const auto rankOf = [](const auto& contact, int list) -> Rank {
    if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
      return {contact.timeOfImpact,
              list,
              {contact.edgeA[0], contact.edgeA[1], contact.edgeB[0], contact.edgeB[1]}};
    else if (list == 1)
      return {contact.timeOfImpact, list, {contact.triangle, contact.vertex, 0, 0}};
    else
      return {contact.timeOfImpact, list, {contact.vertex, contact.triangle, 0, 0}};
  };
  const auto featuresOf = [&](const auto& contact, int list) {
    if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
      return sharedFeatures(contact, meshes.self());
    else
      return sharedFeatures(contact, list == 1, meshes.self());
  };
  std::map<ImpactFeatures, Rank> first;
  const auto recordFirst = [&](const auto& contacts, int list) {
    for (const auto& contact : contacts)
      if (const auto features = featuresOf(contact, list); features && contact.timeOfImpact < end) {
        const Rank rank = rankOf(contact, list);
        const auto [place, isNew] = first.emplace(*features, rank);
        if (!isNew) place->second = std::min(place->second, rank);
      }
  };
  recordFirst(answer.vertexTriangle(), 0);
  recordFirst(answer.triangleVertex(), 1);
  recordFirst(answer.edgeEdge(), 2);
  forEachImpactList(expected, recordFirst);
  const auto isDropped = [&](const auto& contact, int list) {
    const auto features = featuresOf(contact, list);
    const auto place = features ? first.find(*features) : first.end();
    return place != first.end() && contact.timeOfImpact < end &&
           place->second < rankOf(contact, list);
  };
  // Brute force may find a contact at the step's end that Auto reports by its impact. Auto may then
  // drop this impact.
  ExcludedByBruteForce excluded(meshes);
  const auto isDroppedImpact = [&](const auto& contact, int list) {
    if (contact.timeOfImpact < end) return false;
    ContactBuffers impact;
    if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>) {
      const Features<ImpactQuery::Kind::EdgeEdge> features{meshes.a, meshes.b};
      addImpact(meshes, features, meshes.a.topology.edgeOf(contact.edgeA),
                meshes.b.topology.edgeOf(contact.edgeB), false, impact);
    } else {
      const bool swapped = list == 1;
      const Features<ImpactQuery::Kind::VertexTriangle> features{swapped ? meshes.b : meshes.a,
                                                                 swapped ? meshes.a : meshes.b};
      addImpact(meshes, features, contact.vertex, contact.triangle, swapped, impact);
    }
    bool dropped = false;
    forEachImpactList(impact, [&](const auto& contacts, int of) {
      for (const auto& found : contacts)
        dropped |= isDropped(found, of) ||
                   (found.timeOfImpact < end && excluded.isDropped(sided(found, of)));
    });
    return dropped;
  };
  forEachImpactList(expected, [&](auto& contacts, int list) {
    std::erase_if(contacts, [&](const auto& contact) {
      return isDropped(contact, list) || isDroppedImpact(contact, list);
    });
  });
}

}  // namespace palpate
