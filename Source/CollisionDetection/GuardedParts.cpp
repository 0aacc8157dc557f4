#include "CollisionDetection/GuardedParts.h"

#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

namespace {

std::pair<GeometryId, GeometryId> inOrder(GeometryId a, GeometryId b) { return std::minmax(a, b); }

}  // namespace

bool GuardSettings::isLeftOut(GeometryId a, GeometryId b) const {
  return std::find(left.begin(), left.end(), inOrder(a, b)) != left.end();
}

void GuardSettings::leaveOut(GeometryId a, GeometryId b, bool leftOut) {
  if (leftOut && !isLeftOut(a, b)) left.push_back(inOrder(a, b));
  if (!leftOut) std::erase(left, inOrder(a, b));
}

void GuardSettings::fix(GeometryId id, std::span<const std::uint32_t> vertices) {
  std::vector<GuardedVertex> all;
  for (const GuardedVertex& v : fixed)
    if (v.geometry != id) all.push_back(v);
  for (const std::uint32_t v : vertices) all.push_back({id, v});
  std::sort(all.begin(), all.end());
  fixed.swap(all);
}

bool GuardedParts::Body::moves(std::uint32_t node) const {
  PALPATE_ASSERT(node < nodeCount());
  const Positions& before = geometry->body.mesh.before;
  if (!isWhole) return before.body()[node] != given.body()[node];
  return !(before.transform() == given.transform()) || !before.hasSameBody(given);
}

const GuardedParts::Body* GuardedParts::find(GeometryId id) const {
  const auto at = std::lower_bound(
      m_bodies.begin(), m_bodies.end(), id,
      [](const Body& body, GeometryId key) { return body.geometry->body.id < key; });
  return at == m_bodies.end() || at->geometry->body.id != id ? nullptr : &*at;
}

std::uint32_t GuardedParts::partOf(GeometryId id, std::uint32_t vertex) const {
  const Body* body = find(id);
  if (!body) return kNone;
  if (body->isWhole) return partOf(*body, 0);
  return vertex < body->nodeCount() ? partOf(*body, vertex) : kNone;
}

void GuardedParts::start(const GeometryTable& geometries, SeparateSearches pairs,
                         const GuardSettings& settings) {
  m_geometries.clear();
  for (const auto& pair : pairs)
    for (Geometry* geometry : {pair->a, pair->b})
      if (!geometry->body.mesh.before.isSameAs(geometry->body.mesh.now))
        m_geometries.push_back(geometry);
  const auto add = [&](const GuardedVertex& v) {
    if (Geometry* geometry = geometries.find(v.geometry)) m_geometries.push_back(geometry);
  };
  for (const auto& group : settings.groups) std::for_each(group.begin(), group.end(), add);
  std::for_each(settings.fixed.begin(), settings.fixed.end(), add);
  std::sort(m_geometries.begin(), m_geometries.end(),
            [](const Geometry* l, const Geometry* r) { return l->body.id < r->body.id; });
  m_geometries.erase(std::unique(m_geometries.begin(), m_geometries.end()), m_geometries.end());
  m_bodies.clear();
  std::uint32_t nodes = 0;
  for (Geometry* geometry : m_geometries) {
    const TriangleMesh& mesh = geometry->body.mesh;
    const bool isWhole = geometry->body.shape || !(mesh.before.transform() == mesh.now.transform());
    m_bodies.push_back({geometry, mesh.now, nodes, isWhole});
    nodes += m_bodies.back().nodeCount();
  }
  m_parts.start(nodes);
  m_isFixed.assign(nodes, 0);
  m_moves.assign(nodes, 0);
  // The parts of a vertex, or of a whole geometry.
  const auto forEachPart = [&](const GuardedVertex& v, auto&& f) {
    const Body* body = find(v.geometry);
    const bool isAll = v.vertex == kNoElement;
    for (std::uint32_t i = 0; isAll && body && i < body->nodeCount(); ++i) f(partOf(*body, i));
    if (const std::uint32_t part = partOf(v.geometry, v.vertex); !isAll && part != kNone) f(part);
  };
  for (const auto& group : settings.groups) {
    std::uint32_t first = kNone;
    for (const GuardedVertex& v : group)
      forEachPart(v, [&](std::uint32_t part) {
        first = first == kNone ? part : first;
        m_parts.join(first, part);
      });
  }
  for (const GuardedVertex& v : settings.fixed)
    forEachPart(v, [&](std::uint32_t part) { m_isFixed[part] = 1; });
  PALPATE_ASSERT(m_bodies.size() == m_geometries.size());
  for (const Body& body : m_bodies)
    for (std::uint32_t i = 0; i < body.nodeCount(); ++i)
      if (body.moves(i)) m_moves[partOf(body, i)] = 1;
}

}  // namespace palpate
