#include "Diagnostics/DistinctImpacts.h"

#include "CollisionDetection/ExcludedImpacts.h"
#include "CollisionDetection/FirstImpacts.h"
#include "NarrowPhase/Continuous.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <tuple>
#include <type_traits>

namespace palpate {

namespace {

bool keepsDistinctImpacts(const MeshPair& meshes) {
  return meshes.reportsDistinct() &&
         (meshes.settings.method == Method::Continuous || meshes.step.reportsImpacts);
}

/// Contacts::Distinct for impacts of lines and points: drops excluded impacts for which others
/// stand. Computes all impacts of their vertices and edges.
class ExcludedByBruteForce {
 public:
  explicit ExcludedByBruteForce(const MeshPair& meshes) : m_meshes(meshes), m_rule(meshes) {}

  bool isDropped(const VertexTriangleContact& c, bool swapped) {
    if (!m_rule.isExcluded(c, swapped)) return false;
    m_ofVertices.clear();
    addImpactsOf(c.vertex, swapped);
    return m_rule.isReplaced(c, swapped, [&](auto&& f) { return anyOfVertices(swapped, f); });
  }
  bool isDropped(const EdgeEdgeContact& c) {
    if (!m_rule.isExcluded(c)) return false;
    const bool swapped = m_rule.linesAreSecond();
    const Segment& edge = m_rule.lineEdge(c);
    m_ofVertices.clear();
    for (const std::uint32_t end : edge) addImpactsOf(end, swapped);
    findImpactsOf(edge);
    return m_rule.isReplaced(c, [&](auto&& f) {
      return std::any_of(
                 m_ofEdge.edgeEdge.begin(), m_ofEdge.edgeEdge.end(),
                 [&](const auto& s) { return !m_rule.isExcluded(s) && f(s, m_rule.planeOf(s)); }) ||
             anyOfVertices(swapped, f);
    });
  }

 private:
  template <class F>
  bool anyOfVertices(bool swapped, F&& f) const {
    const auto& impacts = swapped ? m_ofVertices.triangleVertex : m_ofVertices.vertexTriangle;
    return std::any_of(impacts.begin(), impacts.end(), [&](const auto& s) {
      return !m_rule.isExcluded(s, swapped) && f(s, m_rule.planeOf(s, swapped));
    });
  }
  void addImpactsOf(std::uint32_t vertex, bool swapped) {
    const Features<ImpactQuery::Kind::VertexTriangle> features{swapped ? m_meshes.b : m_meshes.a,
                                                               swapped ? m_meshes.a : m_meshes.b};
    const MeshTopology& others = (swapped ? m_meshes.a : m_meshes.b).topology;
    for (std::uint32_t t = 0; t < others.elements.size(); ++t)
      if (others.isEnabled(t) && !m_meshes.excludesVertex(vertex, t))
        addImpact(m_meshes, features, vertex, t, swapped, m_ofVertices);
  }
  /// Of an edge of a line near a triangle mesh.
  void findImpactsOf(const Segment& edge) {
    const bool second = m_rule.linesAreSecond();
    const Features<ImpactQuery::Kind::EdgeEdge> features{m_meshes.a, m_meshes.b};
    const std::uint32_t line = (second ? m_meshes.b : m_meshes.a).topology.edgeOf(edge);
    const MeshTopology& others = (second ? m_meshes.a : m_meshes.b).topology;
    m_ofEdge.clear();
    for (std::uint32_t other = 0; other < others.edges.size(); ++other)
      if (!others.edgeTriangles[other].empty())
        addImpact(m_meshes, features, second ? other : line, second ? line : other, false,
                  m_ofEdge);
  }

  const MeshPair& m_meshes;
  const ExcludedImpacts m_rule;
  ContactBuffers m_ofVertices, m_ofEdge;
};

}  // namespace

void dropExcludedImpacts(const MeshPair& meshes, CollisionData::Contents& expected) {
  if (!keepsDistinctImpacts(meshes) || !ExcludedImpacts(meshes).mayExclude()) return;
  ExcludedByBruteForce excluded(meshes);
  forEachImpactList(expected, [&](auto& contacts, int list) {
    std::erase_if(contacts, [&](const auto& contact) {
      if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
        return excluded.isDropped(contact);
      else
        return excluded.isDropped(contact, list == 1);
    });
  });
}

void dropRepeatedImpacts(const MeshPair& meshes, const CollisionData& answer,
                         CollisionData::Contents& expected) {
  if (!keepsDistinctImpacts(meshes)) return;
  const double end =
      meshes.settings.method == Method::Continuous ? std::numeric_limits<double>::infinity() : 1.0;
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
      for (const auto& found : contacts) dropped |= isDropped(found, of);
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
