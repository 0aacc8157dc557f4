#include "Shapes/DistinctContacts.h"

#include "Math/NormalCone.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Cosine: only a normal this near to a cylinder's axis may be that of an end face. Any value below
/// 1 will do.
constexpr double kNearAxis = 0.999;

bool isFirst(const ShapeContact& a, const ShapeContact& b) {
  return std::tie(a.timeOfImpact, a.distance) < std::tie(b.timeOfImpact, b.distance);
}

}  // namespace

struct DistinctContacts::Search {
  const TriangleMesh& mesh;
  const Shape& shape;  ///< at the step's end
  const double timeTolerance;
  const bool hasFlatFaces;  ///< of the shape: only then two contacts have one normal
  const std::span<const ShapeContact> contacts;
  const std::array<Buffer<std::uint32_t>, 3>& firsts;
  const std::span<const State> states;  ///< decided for contacts that are earlier or nearer

  /// Whether elements around the feature of a contact exclude its normal, and that at the end.
  bool isExcluded(const ShapeContact& c) const {
    const auto around = mesh.topology.vertexTriangles[c.vertices[0]];
    const auto isExcludedAt = [&](const Vector3d& normal, double time, double bend) {
      return std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
        const Triangle& corners = mesh.topology.triangles[triangle];
        return isAround(corners, c) && excludes(corners, c, normal, time, bend);
      });
    };
    return isExcludedAt(c.normal, c.timeOfImpact, 0.0) &&
           (c.timeOfImpact == 1.0 || isExcludedAt(normalAtEnd(c), 1.0, kBentSurface));
  }
  State stateOf(const ShapeContact& c) const {
    bool isExcluded = false, isReplaced = false;
    for (const std::uint32_t triangle : mesh.topology.vertexTriangles[c.vertices[0]]) {
      const Triangle& corners = mesh.topology.triangles[triangle];
      if (!isAround(corners, c) || !excludes(corners, c, c.normal, c.timeOfImpact, 0.0)) continue;
      const StandIns standIns = standInsOf(triangle, c);
      if (standIns.exist && !hasFlatFaces) return State::Dropped;
      if (standIns.haveItsNormal) return State::Proper;
      isExcluded = true;
      isReplaced |= standIns.exist;
    }
    return isReplaced ? State::Dropped : isExcluded ? State::Alone : State::Proper;
  }

 private:
  static bool isAround(const Triangle& corners, const ShapeContact& c) {
    return std::find(corners.begin(), corners.end(), c.vertices[1]) != corners.end();
  }
  bool excludes(const Triangle& corners, const ShapeContact& c, const Vector3d& normal, double time,
                double bend) const {
    const Vector3d p = at(c.vertices[0], time);
    return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t corner) {
      if (corner == c.vertices[0] || corner == c.vertices[1]) return false;
      const Vector3d r = at(corner, time);
      return c.element == ShapeElement::Vertex
                 ? leadsTowards(-normal, p, r, bend)
                 : leadsInto(-normal, p, at(c.vertices[1], time), r, bend);
    });
  }
  /// Of the contact's point on the mesh at the step's end.
  Vector3d normalAtEnd(const ShapeContact& c) const {
    Vector3d point = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) point += c.weights[i] * mesh.now[c.vertices[i]];
    return shape.signedDistance(point).normal;
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
    const auto isComplete = [&] { return result.exist && !hasFlatFaces; };
    const auto add = [&](ShapeElement element, std::uint32_t id, std::uint32_t second) {
      const ShapeContact* other = find(element, id, second);
      if (!other || !isFirst(*other, c)) return;
      result.exist = true;
      result.haveItsNormal |=
          states[static_cast<std::size_t>(other - contacts.data())] == State::Proper &&
          (other->normal - c.normal).norm() <= kNormalConeError;
    };
    // The corners across come first: one of them is most often a contact.
    for (const std::uint32_t v : corners)
      if (v != c.vertices[0] && v != c.vertices[1] && !isComplete())
        add(ShapeElement::Vertex, v, v);
    for (const std::uint32_t edge : topology.triangleEdges[triangle])
      if (edge != kNoEdge && !isComplete())
        add(ShapeElement::Edge, topology.edges[edge][0], topology.edges[edge][1]);
    if (result.exist) return result;
    const ShapeContact* face = find(ShapeElement::Face, triangle, corners[1]);
    result.exist = face && face->timeOfImpact <= c.timeOfImpact + timeTolerance;
    return result;
  }

  const ShapeContact* find(ShapeElement element, std::uint32_t id, std::uint32_t second) const {
    std::uint32_t i = firsts[static_cast<std::size_t>(element)][id];
    if (element != ShapeElement::Edge) return i == kNoElement ? nullptr : &contacts[i];
    for (; i < contacts.size(); ++i) {
      const ShapeContact& c = contacts[i];
      if (c.element != element || c.id != id) break;
      if (c.vertices[1] == second) return &c;
    }
    return nullptr;
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
  const bool hasFlatFaces = shape.isCylinder() || shape.faces().size() > 1;
  m_order.clear();
  m_states.assign(contacts.size(), State::Proper);
  const Search search{mesh,     shape,   settings.timeTolerance, hasFlatFaces, contacts,
                      m_firsts, m_states};
  // Where the distance from the shape is smooth, the element that excludes a normal comes nearer.
  // At the step's end nothing but filters, disabled elements and different radii keep it, or a
  // feature of it, from being a contact. The distance is smooth outside, and inside a capsule
  // except on its axis.
  const bool areReplaced = settings.method == Method::Proximity && !mesh.outerSideOnly &&
                           mesh.topology.disabled.empty() && mesh.radii.empty();
  const double smoothBeyond = (hasFlatFaces ? 0.0 : -0.5 * shape.radius()) - mesh.largestRadius;
  const auto mayBeFlat = [&](const ShapeContact& c) {
    return hasFlatFaces &&
           !(shape.isCylinder() && std::abs(shape.axes().col(2).dot(c.normal)) < kNearAxis);
  };
  for (std::uint32_t i = 0; i < contacts.size(); ++i) {
    const ShapeContact& c = contacts[i];
    if (c.element == ShapeElement::Face || !search.isExcluded(c)) continue;
    if (areReplaced && c.distance > smoothBeyond && !mayBeFlat(c))
      m_states[i] = State::Dropped;
    else
      m_order.push_back(i);
  }
  if (hasFlatFaces)
    std::sort(m_order.begin(), m_order.end(),
              [&](std::uint32_t l, std::uint32_t r) { return isFirst(contacts[l], contacts[r]); });
  if (!m_order.empty()) {
    m_firsts[0].resize(mesh.topology.vertexCount, kNoElement);
    m_firsts[1].resize(mesh.topology.vertexCount, kNoElement);
    m_firsts[2].resize(mesh.topology.triangles.size(), kNoElement);
    const auto placeOf = [&](std::size_t i) -> std::uint32_t& {
      return m_firsts[static_cast<std::size_t>(contacts[i].element)][contacts[i].id];
    };
    for (std::size_t i = contacts.size(); i-- > 0;) placeOf(i) = static_cast<std::uint32_t>(i);
    for (const std::uint32_t i : m_order) m_states[i] = search.stateOf(contacts[i]);
    for (std::size_t i = 0; i < contacts.size(); ++i) placeOf(i) = kNoElement;
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (m_states[i] != State::Dropped) contacts[kept++] = contacts[i];
  return kept;
}

}  // namespace palpate
