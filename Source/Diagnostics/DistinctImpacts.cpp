#include "Diagnostics/DistinctImpacts.h"

#include "NarrowPhase/Continuous.h"
#include "Contact/ContactLists.h"
#include "Mesh/ExcludedDirections.h"
#include "Math/NormalCone.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

namespace palpate {

namespace {

using Eigen::Vector3d;
using VertexIds = std::vector<std::uint32_t>;  // ascending, each once

bool keepsDistinctImpacts(const MeshPair& meshes) {
  return meshes.reportsDistinct() &&
         (meshes.settings.method == Method::Continuous || meshes.step.reportsImpacts);
}

/// Contacts with this time or a later one are those of the step's end.
double endOfImpacts(const MeshPair& meshes) {
  return meshes.settings.method == Method::Continuous ? std::numeric_limits<double>::infinity()
                                                      : 1.0;
}

/// What one mesh has of an impact.
struct ImpactSide {
  VertexIds element, closest;  ///< vertices of the element, and those of its closest part
  std::vector<std::pair<std::uint32_t, double>> weights{};  ///< of the closest point

  void add(std::uint32_t vertex, double weight) {
    element.push_back(vertex);
    if (weight != 0.0) closest.push_back(vertex);
    weights.emplace_back(vertex, weight);
    for (VertexIds* ids : {&element, &closest}) {
      std::sort(ids->begin(), ids->end());
      ids->erase(std::unique(ids->begin(), ids->end()), ids->end());
    }
  }
  Segment feature() const { return {closest.front(), closest.back()}; }
  bool isPartOf(const VertexIds& whole) const {
    return std::includes(whole.begin(), whole.end(), element.begin(), element.end());
  }
  /// L: the closest point at the step's end, and the radius there.
  std::pair<Vector3d, double> placeIn(const TriangleMesh& mesh) const {
    std::pair<Vector3d, double> place(Vector3d::Zero(), 0.0);
    for (const auto& [vertex, weight] : weights) {
      place.first += weight * mesh.now[vertex];
      place.second += weight * mesh.radius(vertex);
    }
    return place;
  }
};

/// An impact as the sets of vertices that it names.
struct NamedImpact {
  std::array<ImpactSide, 2> sides;  ///< of MeshPair::a and of MeshPair::b
  ContactKind kind;
  Vector3d normal;  ///< unit, from b to a
  double time, distance;

  template <class Contact>
  NamedImpact(ContactKind ofList, const Contact& c)
      : kind(ofList), normal(c.normal), time(c.timeOfImpact), distance(c.distance) {
    const Stencil all = stencil(c);
    const auto ofMesh = sidesOf(kind);
    if (ofMesh[0] == 1) normal = -normal;
    for (std::size_t i = 0; i < 4; ++i)
      sides[ofMesh[i]].add(all.vertices[i], std::abs(all.weights[i]));
  }
  bool isOfEdges() const { return kind == ContactKind::EdgeEdge; }
  bool isOfFace() const { return sides[0].closest.size() == 3 || sides[1].closest.size() == 3; }
  /// From the other side to this one.
  Vector3d upTo(std::size_t side) const { return side == 0 ? normal : Vector3d(-normal); }
  TangentPlane planeTo(std::size_t side, const MeshPair& meshes) const {
    const auto [own, ownRadius] = sides[side].placeIn(meshes.meshOf(side));
    const auto [other, radius] = sides[1 - side].placeIn(meshes.meshOf(1 - side));
    const Vector3d up = upTo(side);
    return {up, other, radius, up.dot(own - other) - radius - ownRadius, meshes.settings.thickness};
  }
};

/// Whether an impact has features that other impacts may have, too.
bool hasSharedFeatures(const NamedImpact& c) {
  return !c.isOfFace() &&
         !(c.isOfEdges() && c.sides[0].closest.size() == 2 && c.sides[1].closest.size() == 2);
}

/// Contacts::Distinct for impacts: drops excluded impacts for which others stand. Computes all
/// impacts of the elements that may be held, and compares each with each.
class ExcludedByBruteForce {
 public:
  explicit ExcludedByBruteForce(const MeshPair& meshes)
      : m_meshes(meshes),
        m_haveFaces(meshes.a.topology.hasFaces() && meshes.b.topology.hasFaces()) {}

  bool isDropped(const NamedImpact& c) {
    if (!isExcluded(c)) return false;
    const auto sides = heldSidesOf(c);
    return std::any_of(sides.begin(), sides.end(), [&](std::size_t side) {
      const std::vector<Holder> holders = holdersOf(c.sides[side].element, side);
      return std::any_of(holders.begin(), holders.end(),
                         [&](const Holder& s) { return standsFor(s, c, side, holders); });
    });
  }

 private:
  struct Holder {
    NamedImpact impact;
    std::size_t side;
  };

  /// Whether elements around a closest vertex or edge come nearer to the other closest point.
  bool isExcluded(const NamedImpact& c) const {
    if (c.isOfFace()) return false;
    for (std::size_t side = 0; side < 2; ++side) {
      const TriangleMesh& mesh = m_meshes.meshOf(side);
      const bool isTested =
          m_haveFaces || (c.isOfEdges() ? mesh.topology.hasFaces() : side != sidesOf(c.kind)[0]);
      if (isTested && excludesDirection(mesh, c.sides[side].feature(), c.upTo(1 - side), c.time))
        return true;
    }
    return false;
  }
  std::vector<std::size_t> heldSidesOf(const NamedImpact& c) const {
    if (m_haveFaces) return {0, 1};
    if (!c.isOfEdges()) return {sidesOf(c.kind)[0]};
    return {m_meshes.a.topology.hasFaces() ? std::size_t{1} : 0};
  }
  bool standsFor(const Holder& s, const NamedImpact& c, std::size_t side,
                 const std::vector<Holder>& holders) const {
    const ImpactSide &held = c.sides[side], &other = c.sides[1 - side];
    const ImpactSide& own = s.impact.sides[s.side];
    const TriangleMesh &mesh = m_meshes.meshOf(side), &others = m_meshes.meshOf(1 - side);
    const bool isInTime =
        s.impact.isOfFace()
            ? s.impact.time <= c.time + m_meshes.settings.continuous.timeTolerance
            : std::tie(s.impact.time, s.impact.distance) < std::tie(c.time, c.distance);
    TangentPlane plane = s.impact.planeTo(s.side, m_meshes);
    const auto isIn = [&](std::uint32_t v) {
      return plane.touches(others.now[v], others.radius(v));
    };
    if (!isInTime || !std::all_of(other.element.begin(), other.element.end(), isIn)) return false;
    if (held.element.size() == 1) return true;
    for (const Holder& each : holders) {
      const TangentPlane its = each.impact.planeTo(each.side, m_meshes);
      if (plane.isSameAs(its)) plane.gap = std::min(plane.gap, its.gap);
    }
    const auto isInFront = [&](std::uint32_t v) {
      return plane.hasInFront(mesh.now[v], mesh.radius(v));
    };
    if (!std::all_of(held.element.begin(), held.element.end(), isInFront)) return false;
    if (own.element.size() == 1 && own.element == held.closest) return true;
    double length = 0.0;
    for (const std::uint32_t p : held.element)
      for (const std::uint32_t q : held.element)
        length = std::max(length, (mesh.now[p] - mesh.now[q]).norm());
    return !hasRidge(others, other.feature(), c.upTo(side), length, m_meshes.settings.thickness);
  }

  /// All impacts that are not excluded and hold the element or a part of it.
  std::vector<Holder> holdersOf(const VertexIds& held, std::size_t side) {
    m_found.clear();
    const MeshTopology& topology = m_meshes.meshOf(side).topology;
    for (const std::uint32_t vertex : held) addOfVertex(vertex, side);
    for (const std::uint32_t p : held)
      for (const std::uint32_t q : held)
        if (const auto e = topology.edgeOf({p, q}); p < q && e != kNoEdge) addOfEdge(e, side);
    for (const std::uint32_t t : topology.vertexTriangles[held[0]]) {
      VertexIds corners(topology.elements[t].begin(), topology.elements[t].end());
      std::sort(corners.begin(), corners.end());
      if (corners == held) addOfTriangle(t, side);
    }
    std::vector<Holder> holders;
    forEachMeshList(m_found, [&](ContactKind kind, const auto& contacts) {
      for (const auto& contact : contacts) {
        const NamedImpact impact(kind, contact);
        if (isExcluded(impact)) continue;
        for (const std::size_t own : heldSidesOf(impact))
          if ((own == side || m_meshes.self()) && impact.sides[own].isPartOf(held))
            holders.push_back({impact, own});
      }
    });
    return holders;
  }
  void addOfVertex(std::uint32_t vertex, std::size_t side) {
    const MeshTopology& others = m_meshes.meshOf(1 - side).topology;
    for (std::uint32_t t = 0; t < others.elements.size(); ++t)
      if (others.isEnabled(t)) add(vertex, t, side == 1 && !m_meshes.self());
  }
  void addOfTriangle(std::uint32_t triangle, std::size_t side) {
    const MeshTopology& others = m_meshes.meshOf(1 - side).topology;
    for (std::uint32_t v = 0; v < others.vertexCount; ++v)
      if (!others.vertexTriangles[v].empty()) add(v, triangle, side == 0 && !m_meshes.self());
  }
  void addOfEdge(std::uint32_t edge, std::size_t side) {
    const Features<ImpactQuery::Kind::EdgeEdge> features{m_meshes.a, m_meshes.b};
    const MeshTopology& others = m_meshes.meshOf(1 - side).topology;
    for (std::uint32_t other = 0; other < others.edges.size(); ++other) {
      if (others.edgeTriangles[other].empty() || m_meshes.excludesEdges(edge, other)) continue;
      const bool swap = m_meshes.self() ? others.precedes(other, edge) : side == 1;
      addImpact(m_meshes, features, swap ? other : edge, swap ? edge : other, false, m_found);
    }
  }
  /// swapped: the vertex is of MeshPair::b.
  void add(std::uint32_t vertex, std::uint32_t triangle, bool swapped) {
    const TriangleMesh &own = m_meshes.meshOf(swapped), &others = m_meshes.meshOf(!swapped);
    if (!areTested(own.topology, others.topology, !swapped) ||
        m_meshes.excludesVertex(vertex, triangle))
      return;
    addImpact(m_meshes, Features<ImpactQuery::Kind::VertexTriangle>{own, others}, vertex, triangle,
              swapped, m_found);
  }

  const MeshPair& m_meshes;
  const bool m_haveFaces;
  ContactBuffers m_found;
};

}  // namespace

void dropExcludedImpacts(const MeshPair& meshes, CollisionData::Contents& expected) {
  if (!keepsDistinctImpacts(meshes)) return;
  const double end = endOfImpacts(meshes);
  ExcludedByBruteForce excluded(meshes);
  forEachMeshList(expected, [&](ContactKind kind, auto& contacts) {
    std::erase_if(contacts, [&](const auto& contact) {
      return contact.timeOfImpact < end && excluded.isDropped(NamedImpact(kind, contact));
    });
  });
}

void dropRepeatedImpacts(const MeshPair& meshes, const CollisionData& answer,
                         CollisionData::Contents& expected) {
  if (!keepsDistinctImpacts(meshes)) return;
  const double end = endOfImpacts(meshes);
  using Rank = std::pair<double, ContactKey>;
  using ClosestFeatures = std::pair<VertexIds, VertexIds>;
  std::map<ClosestFeatures, Rank> first;
  const auto featuresOf = [&](const NamedImpact& c) {
    ClosestFeatures features{c.sides[0].closest, c.sides[1].closest};
    const auto isAfter = [](const VertexIds& l, const VertexIds& r) {
      return std::tie(l.front(), l.back()) > std::tie(r.front(), r.back());
    };
    if (meshes.self() && isAfter(features.first, features.second))
      std::swap(features.first, features.second);
    return features;
  };
  const auto recordFirst = [&](ContactKind kind, const auto& contacts) {
    for (const auto& contact : contacts) {
      const NamedImpact impact(kind, contact);
      if (!(contact.timeOfImpact < end) || !hasSharedFeatures(impact)) continue;
      const Rank rank{contact.timeOfImpact, keyOf(kind, contact)};
      const auto [place, isNew] = first.emplace(featuresOf(impact), rank);
      if (!isNew) place->second = std::min(place->second, rank);
    }
  };
  forEachMeshList(CollisionData::Contents::read(answer), recordFirst);
  forEachMeshList(expected, recordFirst);
  const auto isDropped = [&](const NamedImpact& impact, const ContactKey& key) {
    if (!(impact.time < end) || !hasSharedFeatures(impact)) return false;
    const auto place = first.find(featuresOf(impact));
    return place != first.end() && place->second < Rank(impact.time, key);
  };
  // Brute force may find a contact at the step's end that Auto reports by its impact. Auto may then
  // drop this impact.
  ExcludedByBruteForce excluded(meshes);
  const auto isDroppedImpact = [&](ContactKind kind, const auto& contact) {
    if (contact.timeOfImpact < end) return false;
    ContactBuffers impact;
    addImpactOf(meshes, kind, contact, impact);
    bool dropped = false;
    forEachMeshList(impact, [&](ContactKind of, const auto& contacts) {
      for (const auto& found : contacts) {
        const NamedImpact named(of, found);
        dropped |= isDropped(named, keyOf(of, found)) ||
                   (found.timeOfImpact < end && excluded.isDropped(named));
      }
    });
    return dropped;
  };
  forEachMeshList(expected, [&](ContactKind kind, auto& contacts) {
    std::erase_if(contacts, [&](const auto& contact) {
      return isDropped(NamedImpact(kind, contact), keyOf(kind, contact)) ||
             isDroppedImpact(kind, contact);
    });
  });
}

}  // namespace palpate
