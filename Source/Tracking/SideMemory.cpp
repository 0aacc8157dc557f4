#include "Tracking/SideMemory.h"

#include "Tracking/SideFeatures.h"
#include "NarrowPhase/Proximity.h"
#include "Contact/SmoothNormals.h"
#include "Contact/ContactLists.h"
#include "Math/ClosestPoint.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;
using Side = SideMemory::Side;

bool areEqual(const Side& l, const Side& r) {
  return l.passage == r.passage && l.corners == r.corners;
}

/// The contacts of a remembered side: at the step's start, with the normal that leads back.
VertexTriangleContact contactOfVertex(const MeshPair& pair, const Side& side) {
  const VertexSide of(pair, side.passage.kind);
  const std::uint32_t vertex = of.vertexOf(side.passage);
  VertexTriangleDistance measured = distanceOf(of, vertex, side.corners, false);
  if (measured.feature == TriangleFeature::Face || measured.distance == 0.0) {
    const Positions& p = of.triangles.before;
    const auto& [a, b, c] = side.corners;
    measured.normal = windingNormal(p[a], p[b], p[c]);
    if (!side.passage.forward) measured.normal = -measured.normal;
  }
  VertexTriangleContact contact =
      contactOf(vertex, of.triangleOf(side.passage), side.corners, measured, 0.0);
  turn(contact);
  contact.distance -= pair.a.largestRadius + pair.b.largestRadius;
  return contact;
}

EdgeEdgeContact contactOfEdges(const MeshPair& pair, const Side& side) {
  const Segment a = edgeA(side.passage), b = edgeB(side.passage);
  EdgeEdgeDistance measured = distanceOf(pair, a, b, false);
  const bool areInteriors =
      measured.featureA == EdgeFeature::Interior && measured.featureB == EdgeFeature::Interior;
  if ((areInteriors || measured.distance == 0.0) && !measured.parallel) {
    const Positions &p = pair.a.before, &q = pair.b.before;
    measured.normal = normalOfCrossing(p[a[0]], p[a[1]], q[b[0]], q[b[1]]);
    if (!side.passage.forward) measured.normal = -measured.normal;
  }
  EdgeEdgeContact contact = contactOf(a, b, measured, 0.0);
  turn(contact);
  contact.distance -= pair.a.largestRadius + pair.b.largestRadius;
  return contact;
}

template <class Contact>
void insert(CountedVector<Contact>& contacts, ContactKind kind, const Contact& contact) {
  const ContactKey key = keyOf(kind, contact);
  const auto place =
      std::lower_bound(contacts.begin(), contacts.end(), key,
                       [&](const Contact& l, const ContactKey& r) { return keyOf(kind, l) < r; });
  PALPATE_ASSERT(place == contacts.end() || keyOf(kind, *place) != key);
  contacts.insert(place, contact);
}

}  // namespace

void SideMemory::startStep(std::uint64_t step) noexcept {
  if (std::exchange(m_step, step) == step) return;
  if (std::ranges::equal(m_start, m_end, areEqual)) return;
  m_start.swap(m_end);
  ++m_version;
}

void SideMemory::set(std::uint64_t step, std::span<const Side> sides) {
  m_start.assign(sides.begin(), sides.end());
  sortUnique(m_start);
  m_step = step;
  ++m_version;
}

void SideMemory::followNone() noexcept {
  m_next.clear();
  m_courses.clear();
}

/// The side to which vertices with weight had passed; none if they had not, or to both sides.
SideMemory::PartSide SideMemory::sideOf(const MeshPair& pair, ContactKind kind,
                                        const Part& part) const {
  PartSide found{{}, true, Vector3d::Zero()};
  const Positions& p = VertexSide(pair, kind).triangles.before;
  for (std::size_t i = 0; i < part.size; ++i) {
    if (part.weights[i] == 0.0) continue;
    const Side* const side = m_courses.sideAtStart(kind, part.vertices[i]);
    found.isWhole &= side != nullptr;
    if (!side) continue;
    const bool forward = side->passage.forward;
    if (found.forward.value_or(forward) != forward) return {{}, false, Vector3d::Zero()};
    found.forward = forward;
    const auto& [a, b, c] = side->corners;
    found.back += (forward ? -1.0 : 1.0) * part.weights[i] * windingNormal(p[a], p[b], p[c]);
  }
  return found;
}

/// Turns contacts of elements all of whose vertices had passed through the other mesh. Not where
/// they are clearly on the side from which they came: this is another fold of the surface. And not
/// where they clearly lead the way back already: this is the far wall of a body. Elements
/// of which some vertices had passed pierce the surface; those of their contacts that lead
/// these vertices further behind it are removed.
void SideMemory::turnPassed(const MeshPair& pair, Contents& contents) const {
  constexpr double kClearly = 0.5;  // a cosine; directions along the surface are on no side
  constexpr ContactKind kOfA = ContactKind::VertexTriangle, kOfB = ContactKind::TriangleVertex;
  enum class Change { None, Turned, Removed };
  // part: of MeshPair::b or a; onSurface: of the other mesh. toA: from b to a.
  const auto changeOf = [&](const Part& part, const Part& onSurface, bool ofB, const Vector3d& toA,
                            double time) {
    const PartSide side = sideOf(pair, ofB ? kOfB : kOfA, part);
    if (!side.forward) return Change::None;
    const Vector3d normal =
        interpolatedNormal(ofB ? pair.a : pair.b, onSurface.ids(), onSurface.weights.data(), time);
    const Vector3d direction = ofB ? Vector3d(-toA) : toA;
    const double back = (*side.forward ? -1.0 : 1.0) * direction.dot(normal);
    const bool isFarWall = direction.dot(side.back) > kClearly * side.back.norm();
    if (side.isWhole) return back < kClearly && !isFarWall ? Change::Turned : Change::None;
    return back < 0.0 ? Change::Removed : Change::None;
  };
  const auto changeOfContact = [&](ContactKind kind, const auto& contact) {
    std::array<Part, 2> parts;
    const Stencil all = stencil(contact);
    const auto sides = sidesOf(kind);
    for (std::size_t i = 0; i < 4; ++i)
      parts[sides[i]].add(all.vertices[i], std::abs(all.weights[i]));
    const bool swapped = sides[0] == 1;
    const Vector3d toA = swapped ? Vector3d(-contact.normal) : contact.normal;
    const Change ofA = changeOf(parts[0], parts[1], false, toA, contact.timeOfImpact),
                 ofB = changeOf(parts[1], parts[0], true, toA, contact.timeOfImpact);
    if (ofA == Change::Turned || ofB == Change::Turned) return Change::Turned;
    return ofA == Change::None ? ofB : ofA;
  };
  forEachMeshList(contents, [&](ContactKind kind, auto& contacts) {
    std::erase_if(contacts, [&](const auto& contact) {
      return changeOfContact(kind, contact) == Change::Removed;
    });
    for (auto& contact : contacts) {
      if (changeOfContact(kind, contact) != Change::Turned) continue;
      turn(contact);
      contact.distance -= 2.0 * (pair.a.largestRadius + pair.b.largestRadius);
    }
  });
}

void SideMemory::follow(const MeshPair& pair, std::span<const Crossing> passages) {
  m_courses.start(pair, m_start, passages.size());
  // Those of vertices first, each kind in the order of time.
  m_order.resize(passages.size());
  std::iota(m_order.begin(), m_order.end(), 0u);
  std::sort(m_order.begin(), m_order.end(), [&](std::uint32_t l, std::uint32_t r) {
    const auto keyOf = [&](std::uint32_t i) {
      return std::tuple(isEdges(passages[i]), passages[i].time, i);
    };
    return keyOf(l) < keyOf(r);
  });
  for (const std::uint32_t i : m_order) m_courses.take(pair, passages[i]);
  m_next.clear();
  m_hooked.clear();
  for (std::uint32_t i = 0; i < m_courses.all().size(); ++i) {
    const SideCourses::Course& course = m_courses.all()[i];
    if (isEdges(course.side.passage) ? hasFaces(pair) : !course.hasPassed)
      m_hooked.add(pair, m_courses, i);
    else if (course.hasPassed && !m_courses.isOfPassedBody(pair, course))
      m_next.push_back(course.side);
  }
  m_hooked.find(pair, m_courses, m_next);
  sortUnique(m_next);
}

void SideMemory::apply(const MeshPair& pair, Contents& contents) const {
  contents.rememberedSides.clear();
  for (const Side& side : m_courses.atStart()) contents.rememberedSides.push_back(side.passage);
  if (m_courses.all().empty()) return;
  forEachMeshList(contents, [&](ContactKind kind, auto& contacts) {
    std::erase_if(contacts, [&](const auto& contact) {
      return m_courses.replaces(pair, {{kind, keyOf(kind, contact).ids}, cornersOf(contact)},
                                contact.timeOfImpact);
    });
  });
  if (!pair.self()) turnPassed(pair, contents);
  for (const Side& side : m_courses.atStart())
    forEachMeshList(contents, [&](auto kind, auto& contacts) {
      if (side.passage.kind != kind) return;
      if constexpr (kind == ContactKind::EdgeEdge)
        insert(contacts, kind, contactOfEdges(pair, side));
      else
        insert(contacts, kind, contactOfVertex(pair, side));
    });
}

std::vector<Crossing> SideMemory::list(const MeshPair& pair, std::uint64_t step) const {
  std::vector<Crossing> all;
  for (Side side : step == m_step ? m_start : m_end)
    if (findFeatures(pair, side)) all.push_back(side.passage);
  return all;
}

void SideMemory::releaseMemory() {
  for (auto* list : {&m_start, &m_end}) releaseSpare(*list);
  m_next = {};
  m_order = {};
  m_courses.releaseMemory();
  m_hooked = {};
}

}  // namespace palpate
