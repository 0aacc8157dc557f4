#include "Shapes/DistinctContacts.h"

#include "Math/NormalCone.h"

#include <algorithm>
#include <array>
#include <tuple>

namespace palpate {

namespace {

using Eigen::Vector3d;

std::array<std::uint32_t, 3> keyOf(const ShapeContact& c) {
  return {static_cast<std::uint32_t>(c.element), c.id, c.vertices[1]};
}

bool isFirst(const ShapeContact& a, const ShapeContact& b) {
  return std::tie(a.timeOfImpact, a.distance) < std::tie(b.timeOfImpact, b.distance);
}

}  // namespace

struct DistinctContacts::Search {
  const TriangleMesh& mesh;
  const double timeTolerance;
  const std::span<const ShapeContact> contacts;
  const std::span<const State> states;  ///< decided for contacts that are earlier or nearer

  State stateOf(const ShapeContact& c) const {
    const MeshTopology& topology = mesh.topology;
    const auto around =
        c.element == ShapeElement::Vertex
            ? topology.vertexTriangles[c.id]
            : topology.edgeTriangles[topology.edgeOf({c.vertices[0], c.vertices[1]})];
    bool isExcluded = false, isReplaced = false;
    for (const std::uint32_t triangle : around) {
      if (!excludes(triangle, c)) continue;
      const StandIns standIns = standInsOf(triangle, c);
      if (standIns.haveItsNormal) return State::Proper;
      isExcluded = true;
      isReplaced |= standIns.exist;
    }
    return isReplaced ? State::Dropped : isExcluded ? State::Alone : State::Proper;
  }

 private:
  bool excludes(std::uint32_t triangle, const ShapeContact& c) const {
    const Triangle& corners = mesh.topology.triangles[triangle];
    const Vector3d p = at(c.vertices[0], c.timeOfImpact);
    return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t corner) {
      if (corner == c.vertices[0] || corner == c.vertices[1]) return false;
      const Vector3d r = at(corner, c.timeOfImpact);
      return c.element == ShapeElement::Vertex
                 ? leadsTowards(-c.normal, p, r)
                 : leadsInto(-c.normal, p, at(c.vertices[1], c.timeOfImpact), r);
    });
  }

  struct StandIns {
    bool exist = false, haveItsNormal = false;
  };
  /// The triangle, and other vertices and edges of it that are earlier or nearer, as far as they
  /// are contacts. haveItsNormal: one that is proper, other than the triangle, has the normal of c.
  StandIns standInsOf(std::uint32_t triangle, const ShapeContact& c) const {
    const MeshTopology& topology = mesh.topology;
    const Triangle& corners = topology.triangles[triangle];
    StandIns result;
    const ShapeContact* face = find(ShapeElement::Face, triangle, corners[1]);
    result.exist = face && face->timeOfImpact <= c.timeOfImpact + timeTolerance;
    const auto add = [&](ShapeElement element, std::uint32_t id, std::uint32_t second) {
      const ShapeContact* other = find(element, id, second);
      if (!other || !isFirst(*other, c)) return;
      result.exist = true;
      result.haveItsNormal |=
          states[static_cast<std::size_t>(other - contacts.data())] == State::Proper &&
          (other->normal - c.normal).norm() <= kNormalConeError;
    };
    for (int i = 0; i < 3; ++i) {
      add(ShapeElement::Vertex, corners[i], corners[i]);
      const std::uint32_t edge = topology.triangleEdges[triangle][i];
      if (edge != kNoEdge)
        add(ShapeElement::Edge, topology.edges[edge][0], topology.edges[edge][1]);
    }
    return result;
  }

  const ShapeContact* find(ShapeElement element, std::uint32_t id, std::uint32_t second) const {
    const std::array<std::uint32_t, 3> key{static_cast<std::uint32_t>(element), id, second};
    const auto place =
        std::lower_bound(contacts.begin(), contacts.end(), key,
                         [](const ShapeContact& c, const auto& k) { return keyOf(c) < k; });
    return place != contacts.end() && keyOf(*place) == key ? &*place : nullptr;
  }

  Vector3d at(std::uint32_t vertex, double time) const {
    if (time == 1.0) return mesh.now[vertex];
    if (time == 0.0) return mesh.before[vertex];
    return (1.0 - time) * mesh.before[vertex] + time * mesh.now[vertex];
  }
};

std::size_t DistinctContacts::keep(const TriangleMesh& mesh, const Shape& shape,
                                   const PairSettings& settings, std::span<ShapeContact> contacts) {
  if (settings.contacts == Contacts::All || shape.isPlane()) return contacts.size();
  m_order.clear();
  for (std::uint32_t i = 0; i < contacts.size(); ++i)
    if (contacts[i].element != ShapeElement::Face) m_order.push_back(i);
  std::sort(m_order.begin(), m_order.end(),
            [&](std::uint32_t l, std::uint32_t r) { return isFirst(contacts[l], contacts[r]); });
  m_states.assign(contacts.size(), State::Proper);
  const Search search{mesh, settings.timeTolerance, contacts, m_states};
  for (const std::uint32_t i : m_order) m_states[i] = search.stateOf(contacts[i]);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (m_states[i] != State::Dropped) contacts[kept++] = contacts[i];
  return kept;
}

}  // namespace palpate
