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

}  // namespace

struct DistinctContacts::Search {
  const TriangleMesh& mesh;
  const double timeTolerance;
  const std::span<const ShapeContact> contacts;

  bool isDropped(const ShapeContact& c) const {
    const MeshTopology& topology = mesh.topology;
    if (c.element == ShapeElement::Face) return false;
    const auto around =
        c.element == ShapeElement::Vertex
            ? topology.vertexTriangles[c.id]
            : topology.edgeTriangles[topology.edgeOf({c.vertices[0], c.vertices[1]})];
    return std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
      return excludes(triangle, c) && standsFor(triangle, c);
    });
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

  /// Whether the triangle is a contact, or another vertex or edge of it is a contact that is
  /// earlier or nearer.
  bool standsFor(std::uint32_t triangle, const ShapeContact& c) const {
    const MeshTopology& topology = mesh.topology;
    const Triangle& corners = topology.triangles[triangle];
    const ShapeContact* face = find(ShapeElement::Face, triangle, corners[1]);
    if (face && face->timeOfImpact <= c.timeOfImpact + timeTolerance) return true;
    const auto isFirst = [&](ShapeElement element, std::uint32_t id, std::uint32_t second) {
      const ShapeContact* other = find(element, id, second);
      return other &&
             std::tie(other->timeOfImpact, other->distance) < std::tie(c.timeOfImpact, c.distance);
    };
    for (int i = 0; i < 3; ++i) {
      if (isFirst(ShapeElement::Vertex, corners[i], corners[i])) return true;
      const std::uint32_t edge = topology.triangleEdges[triangle][i];
      if (edge == kNoEdge) continue;
      const auto& [p, q] = topology.edges[edge];
      if (isFirst(ShapeElement::Edge, p, q)) return true;
    }
    return false;
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
  const Search search{mesh, settings.timeTolerance, contacts};
  m_dropped.clear();
  for (const ShapeContact& c : contacts) m_dropped.push_back(search.isDropped(c));
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (!m_dropped[i]) contacts[kept++] = contacts[i];
  return kept;
}

}  // namespace palpate
