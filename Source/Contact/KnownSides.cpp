#include "Contact/KnownSides.h"

#include "Contact/ContactLists.h"
#include "Contact/Filters.h"
#include "Mesh/Corners.h"
#include "Exact/Predicates.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <tuple>

namespace palpate {

namespace {

bool isBehind(const Corners& triangle, const Eigen::Vector3d& position) {
  SignCounts counts;
  return orient3d(triangle[0], triangle[1], triangle[2], position, counts) < 0;
}

bool isBeyondBorder(const TriangleMesh& surface, const VertexTriangleContact& c) {
  return isBeyondBorder(surface, featureOf(surface.topology, c.triangle, c.feature), c.normal,
                        c.timeOfImpact);
}

}  // namespace

void KnownSides::add(const ContactBuffers& found, Buffer<Side>& sides) {
  for (const auto* list : {&found.vertexTriangle, &found.triangleVertex})
    for (const VertexTriangleContact& c : *list)
      if (c.distance < 0.0)
        sides.push_back({{list == &found.triangleVertex, c.vertex, c.triangle, c.normal}});
  for (const LeavingVertex& vertex : found.beyondBorder) sides.push_back({vertex});
}

void KnownSides::sort(Buffer<Side>& sides) {
  std::sort(sides.begin(), sides.end(), [](const Side& l, const Side& r) {
    return std::tie(l.ofB, l.vertex, l.triangle) < std::tie(r.ofB, r.vertex, r.triangle);
  });
  const auto last = std::unique(sides.begin(), sides.end(), [](const Side& l, const Side& r) {
    return std::tie(l.ofB, l.vertex, l.triangle) == std::tie(r.ofB, r.vertex, r.triangle);
  });
  sides.erase(last, sides.end());
}

std::span<KnownSides::Side> KnownSides::sidesAt(Buffer<Side>& sides, bool ofB,
                                                std::uint32_t vertex) {
  const auto isBefore = [&](const Side& side) {
    return std::tie(side.ofB, side.vertex) < std::tie(ofB, vertex);
  };
  const auto first = std::partition_point(sides.begin(), sides.end(), isBefore);
  return {first, std::find_if(first, sides.end(), [&](const Side& side) {
            return side.ofB != ofB || side.vertex != vertex;
          })};
}

bool KnownSides::isOfB(ContactKind kind, std::size_t place) const {
  return sidesOf(kind)[place] == 1 && !m_self;
}

void KnownSides::findBeside(const MeshPair& pair, bool atStart,
                            std::span<ContactBuffers* const> others, Buffer<Side>& known,
                            Buffer<Side>& beside) {
  beside.clear();
  if (known.empty()) return;
  for (const ContactBuffers* found : others)
    for (const auto* list : {&found->vertexTriangle, &found->triangleVertex}) {
      const bool ofB = list == &found->triangleVertex;
      const TriangleMesh& surface = pair.meshOf(!ofB);
      for (const VertexTriangleContact& c : *list) {
        if ((c.timeOfImpact < 1.0) == atStart && sidesAt(known, ofB, c.vertex).empty() &&
            liesBelow(surface, featureOf(surface.topology, c.triangle, c.feature), c.normal,
                      c.timeOfImpact) &&
            !isBeyondBorder(surface, c) &&
            (atStart ||
             isBehind(cornersOf(c.vertices, surface.now), pair.meshOf(ofB).now[c.vertex])))
          beside.push_back({{ofB, c.vertex, c.triangle, -c.normal}});
      }
    }
  if (beside.empty()) return;
  sort(beside);
  keepReached(pair, known, beside);
}

/// Keeps the sides of vertices to which edges lead from a vertex whose side is known, through
/// others of these.
void KnownSides::keepReached(const MeshPair& pair, const Buffer<Side>& known,
                             Buffer<Side>& beside) {
  m_reached.clear();
  for (const Side& side : known) m_reached.push_back({side.ofB, side.vertex});
  while (!m_reached.empty()) {
    const auto [ofB, vertex] = m_reached.back();
    m_reached.pop_back();
    const MeshTopology& topology = pair.meshOf(ofB).topology;
    for (const std::uint32_t t : topology.vertexTriangles[vertex])
      for (const std::uint32_t next : topology.elements[t]) {
        const std::span<Side> sides = sidesAt(beside, ofB, next);
        if (sides.empty() || sides.front().isReached) continue;
        for (Side& side : sides) side.isReached = true;
        m_reached.push_back({ofB, next});
      }
  }
  std::erase_if(beside, [](const Side& side) { return !side.isReached; });
}

KnownSides::Opinion KnownSides::ask(Buffer<Side>& sides, ContactKind kind, const Stencil& stencil,
                                    const Eigen::Vector3d& normal) {
  Opinion opinion;
  for (std::size_t i = 0; i < 4; ++i) {
    if (stencil.weights[i] == 0.0) continue;
    for (const Side& side : sidesAt(sides, isOfB(kind, i), stencil.vertices[i])) {
      opinion.isKnown = true;
      opinion.isRepresented |= side.isRepresented;
      opinion.agreement += stencil.weights[i] * normal.dot(side.outward);
    }
  }
  return opinion;
}

/// Whether an impact stands for its vertex, which leaves the other surface.
bool KnownSides::represents(ContactKind kind, const VertexTriangleContact& c) {
  const Stencil all = stencil(c), alone{all.vertices, {1.0, 0.0, 0.0, 0.0}};
  if (c.timeOfImpact == 1.0 || ask(m_atEnd, kind, all, c.normal).isKnown) return false;
  const Opinion own = ask(m_atStart, kind, alone, c.normal);
  const double rest = ask(m_atStart, kind, all, c.normal).agreement - own.agreement;
  return own.isKnown && own.agreement * rest >= 0.0;
}

/// Turns a contact that is on the wrong side. Returns true if it is dropped instead.
template <class Contact>
bool KnownSides::settle(const MeshPair& pair, ContactKind kind, Contact& contact, bool drops) {
  const Stencil vertices = stencil(contact);
  Opinion opinion = ask(m_atEnd, kind, vertices, contact.normal);
  if (drops && opinion.isKnown) return true;
  const bool isImpact = contact.timeOfImpact < 1.0;
  if (!opinion.isKnown && isImpact) {
    opinion = ask(m_atStart, kind, vertices, contact.normal);
    if (drops && opinion.isRepresented && !represents(kind, contact)) return true;
  }
  if constexpr (requires { contact.vertex; })
    if (isBeyondBorder(pair.meshOf(!isOfB(kind, 0)), contact)) return false;
  if (!opinion.isKnown) {
    Buffer<Side>& beside = isImpact ? m_besideAtStart : m_besideAtEnd;
    if constexpr (requires { contact.vertex; }) {
      const auto sides = sidesAt(beside, isOfB(kind, 0), contact.vertex);
      if (std::any_of(sides.begin(), sides.end(),
                      [&](const Side& side) { return side.triangle == contact.triangle; }))
        opinion.agreement = -1.0;
    } else {
      opinion = ask(beside, kind, vertices, contact.normal);
    }
  }
  if (opinion.agreement < 0.0) turn(contact);
  return false;
}

void KnownSides::apply(const MeshPair& pair, std::span<ContactBuffers* const> atEnd,
                       const ContactBuffers& atStart, std::span<ContactBuffers* const> others) {
  m_self = pair.self();
  m_atEnd.clear();
  m_atStart.clear();
  for (const ContactBuffers* found : atEnd) add(*found, m_atEnd);
  add(atStart, m_atStart);
  if (m_atEnd.empty() && m_atStart.empty()) return;
  sort(m_atEnd);
  sort(m_atStart);
  findBeside(pair, false, others, m_atEnd, m_besideAtEnd);
  findBeside(pair, true, others, m_atStart, m_besideAtStart);
  const bool drops = pair.reportsDistinct();
  TimeCheck check(32);
  if (drops)
    for (const ContactBuffers* found : others)
      forEachMeshList(*found, [&](ContactKind kind, const auto& list) {
        for (const auto& contact : list) {
          check();
          if (!represents(kind, contact)) continue;
          const std::uint32_t vertex = verticesOf(contact)[0];
          for (Side& side : sidesAt(m_atStart, isOfB(kind, 0), vertex)) side.isRepresented = true;
        }
      });
  for (ContactBuffers* found : others)
    forEachMeshList(*found, [&](ContactKind kind, auto& list) {
      std::erase_if(list, [&](auto& contact) {
        check();
        return settle(pair, kind, contact, drops);
      });
    });
}

}  // namespace palpate
