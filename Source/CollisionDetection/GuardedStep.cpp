#include "CollisionDetection/GuardedStep.h"

#include "Math/Nearing.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Share of the room in front of a part that it leaves. A smaller value lets it go further in this
/// step, and less far in the next.
constexpr double kRoomLeft = 0.125;
/// Rounds in which only what approaches is shortened, before a component is shortened as a whole.
constexpr int kRoundsAlone = 8;
/// Rounds in which a component is shortened as a whole, before it stays at `before`. One suffices,
/// except where positions round.
constexpr int kRoundsTogether = 4;

/// At a fraction of the way, rounded, but not beyond its ends.
double between(double before, double now, double fraction) {
  return std::clamp(before + fraction * (now - before), std::min(before, now),
                    std::max(before, now));
}
Vector3d between(const Vector3d& before, const Vector3d& now, double fraction) {
  if (fraction == 1.0) return now;
  Vector3d p;
  for (int k = 0; k < 3; ++k) p[k] = between(before[k], now[k], fraction);
  return p;
}

/// The rotation is the normalised interpolation of the quaternions along the shorter way.
RigidTransform between(const RigidTransform& before, const RigidTransform& now, double fraction) {
  if (fraction == 0.0) return before;
  if (fraction == 1.0) return now;
  RigidTransform pose{before.rotation, between(before.translation, now.translation, fraction)};
  if (before.rotation == now.rotation) return pose;
  const Eigen::Quaterniond from(before.rotation), to(now.rotation);
  const double side = from.coeffs().dot(to.coeffs()) < 0 ? -1.0 : 1.0;
  Eigen::Quaterniond turned;
  turned.coeffs() = (1.0 - fraction) * from.coeffs() + side * fraction * to.coeffs();
  pose.rotation = turned.normalized().toRotationMatrix();
  return pose;
}

std::pair<GeometryId, GeometryId> inOrder(GeometryId a, GeometryId b) { return std::minmax(a, b); }

std::string elementOf(const Geometry& geometry, std::uint32_t index) {
  const GeometryType type = geometry.body.mesh.topology.type;
  const char* name = type == GeometryType::Lines    ? ", segment "
                     : type == GeometryType::Points ? ", point "
                                                    : ", triangle ";
  return nameOf(geometry) + name + std::to_string(index);
}

std::string edgeOf(const Geometry& geometry, const std::array<std::uint32_t, 2>& edge) {
  return nameOf(geometry) + ", edge (" + std::to_string(edge[0]) + ", " + std::to_string(edge[1]) +
         ")";
}

/// A contact of a list, with the geometries of its vertices.
template <class Contact>
struct Placed {
  const Contact& contact;
  const Geometry &first, &second;  ///< second: of the triangle, of edge b, or the shape
};
template <class Contact>
Placed(const Contact&, const Geometry&, const Geometry&) -> Placed<Contact>;

ImpactQuery queryOf(const Placed<VertexTriangleContact>& placed) {
  const auto& [contact, vertices, triangles] = placed;
  const auto step = [](const Geometry& geometry, std::uint32_t v) {
    return ImpactQuery::Step{geometry.body.mesh.before[v], geometry.body.mesh.now[v]};
  };
  const auto& [a, b, c] = contact.corners;
  return {ImpactQuery::Kind::VertexTriangle,
          {{step(vertices, contact.vertex), step(triangles, a), step(triangles, b),
            step(triangles, c)}}};
}
ImpactQuery queryOf(const Placed<EdgeEdgeContact>& placed) {
  const auto& [contact, first, second] = placed;
  const auto step = [](const Geometry& geometry, std::uint32_t v) {
    return ImpactQuery::Step{geometry.body.mesh.before[v], geometry.body.mesh.now[v]};
  };
  return {ImpactQuery::Kind::EdgeEdge,
          {{step(first, contact.edgeA[0]), step(first, contact.edgeA[1]),
            step(second, contact.edgeB[0]), step(second, contact.edgeB[1])}}};
}

std::array<std::string, 2> namesOf(const Placed<VertexTriangleContact>& placed) {
  return {nameOf(placed.first) + ", vertex " + std::to_string(placed.contact.vertex),
          elementOf(placed.second, placed.contact.triangle)};
}
std::array<std::string, 2> namesOf(const Placed<EdgeEdgeContact>& placed) {
  return {edgeOf(placed.first, placed.contact.edgeA), edgeOf(placed.second, placed.contact.edgeB)};
}
std::array<std::string, 2> namesOf(const Placed<ShapeContact>& placed) {
  return {elementOf(placed.first, placed.contact.id), nameOf(placed.second)};
}
std::array<std::string, 2> namesOf(const Placed<ShapeShapeContact>& placed) {
  return {nameOf(placed.first), nameOf(placed.second)};
}

/// How a point of a placed geometry moves in the step as it is now.
Vector3d displacementOf(const Geometry& geometry, const Vector3d& point) {
  const RigidTransform &before = geometry.body.mesh.before.transform(),
                       &now = geometry.body.mesh.now.transform();
  const Vector3d inBody = before.rotation.transpose() * (point - before.translation);
  return now(inBody) - before(inBody);
}

std::uint32_t elementNumberOf(const VertexTriangleContact& contact) { return contact.vertex; }
std::uint32_t elementNumberOf(const EdgeEdgeContact& contact) { return contact.edgeA[0]; }
std::uint32_t elementNumberOf(const ShapeContact& contact) { return contact.id; }
std::uint32_t elementNumberOf(const ShapeShapeContact&) { return 0; }

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

void DisjointSets::start(std::size_t size) {
  m_parent.resize(size);
  for (std::uint32_t i = 0; i < size; ++i) m_parent[i] = i;
}

std::uint32_t DisjointSets::find(std::uint32_t i) const {
  while (m_parent[i] != i) i = m_parent[i] = m_parent[m_parent[i]];
  return i;
}

void DisjointSets::join(std::uint32_t a, std::uint32_t b) {
  a = find(a), b = find(b);
  m_parent[std::max(a, b)] = std::min(a, b);
}

const GuardedStep::Body* GuardedStep::find(GeometryId id) const {
  const auto at = std::lower_bound(
      m_bodies.begin(), m_bodies.end(), id,
      [](const Body& body, GeometryId key) { return body.geometry->body.id < key; });
  return at == m_bodies.end() || at->geometry->body.id != id ? nullptr : &*at;
}

std::uint32_t GuardedStep::nodeOf(GeometryId id, std::uint32_t vertex) const {
  const Body* body = find(id);
  if (!body) return kNoNode;
  if (body->isWhole) return body->firstNode;
  return vertex < body->given.size() ? body->firstNode + vertex : kNoNode;
}

/// Calls f(node) for the nodes that a vertex, or a whole geometry, stands for.
template <class F>
void GuardedStep::forEachNode(const GuardedVertex& v, F&& f) const {
  const Body* body = find(v.geometry);
  if (!body) return;
  if (v.vertex == kNoElement) {
    for (std::uint32_t i = 0; i < body->nodeCount(); ++i) f(body->firstNode + i);
  } else if (const std::uint32_t node = nodeOf(v.geometry, v.vertex); node != kNoNode) {
    f(node);
  }
}

bool GuardedStep::moves(const Body& body, std::size_t node) const {
  const Positions& before = body.geometry->body.mesh.before;
  if (!body.isWhole) return before.body()[node] != body.given.body()[node];
  return !(before.transform() == body.given.transform()) || !before.hasSameBody(body.given);
}

void GuardedStep::begin(GeometryTable& geometries, const GuardedPairs& pairs,
                        const GuardSettings& settings) {
  m_bodies.clear();
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
  std::size_t nodes = 0;
  for (Geometry* geometry : m_geometries) {
    const TriangleMesh& mesh = geometry->body.mesh;
    const bool isWhole = geometry->body.shape || !(mesh.before.transform() == mesh.now.transform());
    m_bodies.push_back({geometry, mesh.now, static_cast<std::uint32_t>(nodes), isWhole});
    nodes += m_bodies.back().nodeCount();
  }
  m_parts.start(nodes);
  m_connected.start(nodes);
  m_fraction.assign(nodes, 1.0);
  m_factor.assign(nodes, 1.0);
  m_isFixed.assign(nodes, 0);
  m_moves.assign(nodes, 0);
  m_components.assign(nodes, {});
  for (const auto& group : settings.groups) {
    std::uint32_t first = kNoNode;
    for (const GuardedVertex& v : group)
      forEachNode(v, [&](std::uint32_t node) {
        if (first == kNoNode) first = node;
        m_parts.join(first, node);
      });
  }
  for (const GuardedVertex& v : settings.fixed)
    forEachNode(v, [&](std::uint32_t node) { m_isFixed[m_parts.find(node)] = 1; });
  for (const Body& body : m_bodies)
    for (std::size_t i = 0; i < body.nodeCount(); ++i)
      if (moves(body, i)) m_moves[m_parts.find(body.firstNode + static_cast<std::uint32_t>(i))] = 1;
}

bool GuardedStep::canShorten(std::uint32_t part) const {
  return m_moves[part] && !m_isFixed[part] && m_fraction[part] > 0.0;
}

/// Calls f(placed contact, number) for each contact of the pair.
template <class F>
void GuardedStep::forEachContact(const PairRecord& record, F&& f) {
  const Geometry &a = *record.a, &b = *record.b;
  std::size_t number = 0;
  const auto pass = [&](const auto& list, const Geometry& first, const Geometry& second) {
    for (const auto& contact : list) f(Placed{contact, first, second}, number++);
  };
  pass(record.data.vertexTriangle(), a, b);
  pass(record.data.triangleVertex(), b, a);
  pass(record.data.edgeEdge(), a, b);
  pass(record.data.shape(), a.body.shape ? b : a, a.body.shape ? a : b);
  pass(record.data.shapeShape(), a, b);
}

void GuardedStep::addMover(Touch& touch, const Geometry& geometry, std::uint32_t vertex,
                           double approach) const {
  const std::uint32_t node = nodeOf(geometry.body.id, vertex),
                      part = node == kNoNode ? kNoNode : m_parts.find(node);
  for (Mover& mover : touch.movers)
    if (mover.part == part || mover.part == kNoNode) {
      mover.part = part;
      mover.approach += approach;
      return;
    }
}

template <class Contact>
void GuardedStep::addTouch(const Contact& placed, std::size_t pair, std::size_t number) {
  const auto& contact = placed.contact;
  const Geometry &first = placed.first, &second = placed.second;
  using Kind = std::decay_t<decltype(contact)>;
  Touch touch{{}, contact.timeOfImpact, contact.timeOfImpact == 0.0, pair, number};
  touch.movers.fill({kNoNode, 0.0});
  const auto vertex = [&](const Geometry& geometry, std::uint32_t v, double weight) {
    const TriangleMesh& mesh = geometry.body.mesh;
    addMover(touch, geometry, v, weight * contact.normal.dot(mesh.now[v] - mesh.before[v]));
  };
  if constexpr (std::is_same_v<Kind, ShapeContact>) {
    for (int i = 0; i < 3; ++i) vertex(first, contact.vertices[i], contact.weights[i]);
    addMover(touch, second, kNoElement,
             -contact.normal.dot(displacementOf(second, contact.pointOnShape)));
  } else if constexpr (std::is_same_v<Kind, ShapeShapeContact>) {
    addMover(touch, first, kNoElement, contact.normal.dot(displacementOf(first, contact.pointA)));
    addMover(touch, second, kNoElement,
             -contact.normal.dot(displacementOf(second, contact.pointB)));
  } else {
    if (contact.timeOfImpact < kEarlyTime) {
      const ImpactQuery query = queryOf(placed);
      ImpactQuery start = query;
      for (ImpactQuery::Step& step : start.vertices) step.now = step.before;
      touch.atStart = findTouch(start, kGuardTolerance).impact;
      if (touch.atStart && certainlyPart(query)) return;
      // Only features without radii touch as their centre lines do.
      if (const ImpactResult again = findTouch(query, kGuardTolerance);
          again.impact && first.body.mesh.largestRadius + second.body.mesh.largestRadius == 0.0)
        touch.time = again.time;
    }
    const Stencil of = stencil(contact);
    constexpr std::size_t kSecond = std::is_same_v<Kind, VertexTriangleContact> ? 1 : 2;
    for (std::size_t i = 0; i < 4; ++i)
      vertex(i < kSecond ? first : second, of.vertices[i], of.weights[i]);
  }
  m_touches.push_back(touch);
}

void GuardedStep::findTouches(const GuardedPairs& pairs) {
  m_touches.clear();
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (pairs[i]->collides())
      forEachContact(*pairs[i],
                     [&](const auto& placed, std::size_t number) { addTouch(placed, i, number); });
}

bool GuardedStep::canShorten(const Touch& touch) const {
  return std::any_of(touch.movers.begin(), touch.movers.end(), [&](const Mover& mover) {
    return mover.part != kNoNode && canShorten(mover.part);
  });
}

/// Joins the components of parts that touch. Parts at rest and fixed parts join nothing.
void GuardedStep::joinComponents() {
  for (const Touch& touch : m_touches) {
    std::uint32_t first = kNoNode;
    for (const Mover& mover : touch.movers) {
      if (mover.part == kNoNode || !m_moves[mover.part] || m_isFixed[mover.part]) continue;
      const std::uint32_t component = m_connected.find(mover.part);
      if (first == kNoNode) first = component;
      if (component == first) continue;
      const int alone = std::max(m_components[first].alone, m_components[component].alone);
      m_connected.join(first, component);
      first = m_connected.find(first);
      m_components[first] = {alone};
    }
  }
}

/// Leaves a share of the room in front of the parts that approach, if the others move as they do.
void GuardedStep::shortenApproaching(const Touch& touch) {
  double approach = 0, others = 0;
  for (const Mover& mover : touch.movers) {
    const bool approaches = mover.approach < 0 && mover.part != kNoNode && canShorten(mover.part);
    (approaches ? approach : others) += mover.approach;
  }
  const double all = approach + others, room = others - touch.time * all;
  // The normal may be of no use, and lengths may overflow.
  const bool isKnown = approach < 0 && all < 0 && std::isfinite(all);
  const double most = isKnown && room > 0 ? std::min(1.0, -room / approach)
                      : isKnown           ? 0.0
                                          : touch.time;
  for (const Mover& mover : touch.movers) {
    if (mover.part == kNoNode || !canShorten(mover.part)) continue;
    if (isKnown && !(mover.approach < 0)) continue;
    m_factor[mover.part] = std::min(m_factor[mover.part], (1.0 - kRoomLeft) * most);
  }
}

/// Decides how components with touches are shortened, and shortens their parts.
void GuardedStep::shortenComponents() {
  for (Component& component : m_components) component.factor = 2.0;
  for (const Touch& touch : m_touches)
    for (const Mover& mover : touch.movers) {
      if (mover.part == kNoNode || !m_moves[mover.part] || m_isFixed[mover.part]) continue;
      Component& component = m_components[m_connected.find(mover.part)];
      component.factor =
          std::min(component.factor, touch.atStart ? 0.0 : (1.0 - kRoomLeft) * touch.time);
    }
  bool anyTogether = false;
  for (Component& component : m_components) {
    component.shortensAll = component.factor <= 1.0 && component.alone == kRoundsAlone;
    if (component.factor > 1.0) continue;
    if (!component.shortensAll)
      ++component.alone;
    else if (++component.together > kRoundsTogether)
      component.factor = 0.0;
    anyTogether |= component.shortensAll;
  }
  for (const Touch& touch : m_touches) {
    const auto first = std::find_if(touch.movers.begin(), touch.movers.end(), [&](const Mover& m) {
      return m.part != kNoNode && m_moves[m.part] && !m_isFixed[m.part];
    });
    if (!m_components[m_connected.find(first->part)].shortensAll) shortenApproaching(touch);
  }
  for (std::uint32_t part = 0; anyTogether && part < m_factor.size(); ++part)
    if (const Component& component = m_components[m_connected.find(part)]; component.shortensAll)
      m_factor[part] = component.factor;
  for (std::uint32_t part = 0; part < m_factor.size(); ++part)
    m_fraction[part] *= std::exchange(m_factor[part], 1.0);
}

bool GuardedStep::shorten(const GuardedPairs& pairs) {
  findTouches(pairs);
  for (const Touch& touch : m_touches)
    if (!canShorten(touch)) throwRemains(pairs, touch);
  if (m_touches.empty()) return false;
  joinComponents();
  shortenComponents();
  return true;
}

/// Throws an Error about features that touch, when none of them can be shortened.
void GuardedStep::throwRemains(const GuardedPairs& pairs, const Touch& touch) const {
  const bool moves = std::any_of(touch.movers.begin(), touch.movers.end(), [&](const Mover& mover) {
    return mover.part != kNoNode && m_isFixed[mover.part] && m_moves[mover.part];
  });
  forEachContact(*pairs[touch.pair], [&](const auto& placed, std::size_t number) {
    if (number != touch.contact) return;
    const auto [first, second] = namesOf(placed);
    throw Error(ErrorCode::ImpactRemains,
                first + ", and " + second +
                    (moves && !touch.atStart
                         ? " touch within the step, and all their vertices that move are fixed"
                         : " touched before the step"),
                placed.first.body.id, elementNumberOf(placed.contact));
  });
  throw Error(ErrorCode::ImpactRemains, "features touch");  // not reached: the contact exists
}

void GuardedStep::apply(GeometryTable& geometries, const Threads& threads) {
  PALPATE_ASSERT(!m_bodies.empty());
  for (const Body& body : m_bodies) {
    TriangleMesh& mesh = body.geometry->body.mesh;
    const auto fraction = [&](std::size_t node) {
      return m_fraction[m_parts.find(body.firstNode + static_cast<std::uint32_t>(node))];
    };
    if (body.isWhole && fraction(0) < 1.0)
      geometries.setTransform(
          body.geometry->body.id, {},
          between(mesh.before.transform(), body.given.transform(), fraction(0)));
    const std::span<const Vector3d> before = mesh.before.body(), given = body.given.body();
    if (mesh.before.hasSameBody(body.given)) continue;
    bool isShortened = false;
    m_positions.assign(given.begin(), given.end());
    for (std::size_t v = 0; v < given.size(); ++v) {
      const double share = fraction(body.isWhole ? 0 : v);
      if (share == 1.0) continue;
      isShortened = true;
      m_positions[v] = between(before[v], given[v], share);
    }
    if (isShortened) geometries.setPositions(body.geometry->body.id, {}, m_positions, threads);
  }
}

void GuardedStep::undo(GeometryTable& geometries) noexcept {
  for (const Body& body : m_bodies) geometries.restoreNow(*body.geometry, body.given);
  end();
}

void GuardedStep::end() noexcept { m_bodies.clear(); }

void GuardedStep::listHeld(std::vector<HeldVertex>& out) const {
  out.clear();
  for (const Body& body : m_bodies)
    for (std::uint32_t i = 0; i < body.nodeCount(); ++i) {
      const double fraction = m_fraction[m_parts.find(body.firstNode + i)];
      if (fraction < 1.0 && moves(body, i))
        out.push_back({body.geometry->body.id, body.isWhole ? kNoElement : i, fraction});
    }
}

}  // namespace palpate
