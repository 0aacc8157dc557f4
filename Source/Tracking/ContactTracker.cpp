#include "Tracking/ContactTracker.h"

#include "NarrowPhase/Filters.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <utility>

namespace palpate {

namespace {

ContactEnd endOfVertex(const MeshTopology& topology, std::uint32_t vertex) {
  if (vertex >= topology.vertexCount || !topology.isUsed[vertex]) return ContactEnd::Cut;
  return topology.vertexTriangles[vertex].empty() ? ContactEnd::Disabled : ContactEnd::None;
}

ContactEnd endOfElement(const MeshTopology& topology, std::uint32_t element,
                        const Triangle& vertices) {
  if (element >= topology.elements.size() || topology.elements[element] != vertices)
    return ContactEnd::Cut;
  return topology.isEnabled(element) ? ContactEnd::None : ContactEnd::Disabled;
}

ContactEnd endOfEdge(const MeshTopology& topology, const Segment& vertices) {
  const std::uint32_t edge = topology.edgeOf(vertices);
  if (edge == kNoEdge) return ContactEnd::Cut;
  return topology.edgeTriangles[edge].empty() ? ContactEnd::Disabled : ContactEnd::None;
}

/// The reason that counts of those of two features.
ContactEnd firstOf(ContactEnd a, ContactEnd b) {
  if (a == ContactEnd::None || b == ContactEnd::None) return std::max(a, b);
  return std::min(a, b);
}

}  // namespace

bool ContactTracker::startStep(std::uint64_t step, const Contents& last) noexcept {
  if (m_step == step) return false;
  m_step = step;
  m_repeats = false;
  if (std::exchange(m_isDropped, false)) return true;
  m_isHeld = m_hasGrown = false;
  m_beforeOfSecond = last.tracked.elementsOfSecond;
  m_elementsBefore = m_elements;
  return true;
}

bool ContactTracker::hadContacts(const Contents& last) const {
  bool any = false;
  forEachTracked([&](ContactKind, const auto&, const auto& tracked) { any |= !tracked.empty(); },
                 before(last));
  return any;
}

/// Answers take turns with m_held. Their lists soon have the capacity of the largest one.
void ContactTracker::reserveAs(const Contents& next) {
  const auto reserve = [](const auto& list, auto& spare) {
    if (spare.capacity() >= list.capacity()) return;
    spare.clear();
    spare.reserve(list.capacity());
  };
  forEachTracked(
      [&](ContactKind, const auto& contacts, auto& spareContacts, const auto& tracked,
          auto& spareTracked) {
        reserve(contacts, spareContacts);
        reserve(tracked, spareTracked);
      },
      next, m_held);
}

ContactEnd ContactTracker::endOf(const MeshPair& pair, bool collides,
                                 const ContactMatch::Ended& ended) const {
  const auto& [kind, ids] = ended.contact->key;
  const MeshTopology &a = pair.a.topology, &b = pair.b.topology;
  ContactEnd end = ContactEnd::None;
  bool filtered = !collides;
  switch (kind) {
    case ContactKind::VertexTriangle:
      end = firstOf(endOfVertex(a, ids[0]), endOfElement(b, ids[1], ended.vertices[1]));
      if (end == ContactEnd::None)
        filtered = filtered || rejectsVertex(pair, ids[0], ids[1], false);
      break;
    case ContactKind::TriangleVertex:
      end = firstOf(endOfElement(a, ids[0], ended.vertices[0]), endOfVertex(b, ids[1]));
      if (end == ContactEnd::None) filtered = filtered || rejectsVertex(pair, ids[1], ids[0], true);
      break;
    case ContactKind::EdgeEdge: {
      const Segment edgeA{ids[0], ids[1]}, edgeB{ids[2], ids[3]};
      end = firstOf(endOfEdge(a, edgeA), endOfEdge(b, edgeB));
      if (end == ContactEnd::None)
        filtered = filtered || rejectsEdges(pair, a.edgeOf(edgeA), b.edgeOf(edgeB));
      break;
    }
    case ContactKind::Shape: {
      const MeshTopology& mesh = m_beforeOfSecond ? b : a;
      switch (static_cast<ShapeElement>(ids[0])) {
        case ShapeElement::Vertex:
          end = endOfVertex(mesh, ids[1]);
          break;
        case ShapeElement::Edge:
          end = endOfEdge(mesh, {ids[1], ids[2]});
          break;
        case ShapeElement::Face:
          end = endOfElement(mesh, ids[1], ended.vertices[0]);
          break;
      }
      break;
    }
    case ContactKind::ShapeShape:
      break;
  }
  if (end != ContactEnd::None) return end;
  return filtered ? ContactEnd::Filtered : ContactEnd::Apart;
}

void ContactTracker::track(const MeshPair& pair, bool collides,
                           const std::array<ElementsState, 2>& elements, const Contents& last,
                           Contents& next, ContactMatch& scratch) {
  PALPATE_ASSERT(m_step != kNoStep);
  m_keeps = m_isDropped = false;
  m_elements = elements;
  const std::uint32_t grown = m_hasGrown ? 1 : 0;
  scratch.track(before(last), 1 - grown, pair.self(), hasOtherElements(next), next);
  if (!m_isHeld) reserveAs(next);
  if (std::exchange(m_repeats, true)) scratch.takeUserData(last);
  const bool hasReasons =
      !collides || pair.predicate || pair.nearAtRest || m_elementsBefore != elements;
  next.tracked.ended.resize(scratch.ended().size());
  std::size_t count = 0;
  for (const ContactMatch::Ended& ended : scratch.ended()) {
    TrackedContact& contact = next.tracked.ended[count];
    contact.key.kind = ended.contact->key.kind;
    contact.key.ids = ended.contact->key.ids;
    contact.predecessor.reset();
    contact.age = ended.contact->age - grown;
    contact.userData = ended.contact->userData;
    contact.end = ContactEnd::Apart;
    if (hasReasons && !ended.isPredecessor) contact.end = endOf(pair, collides, ended);
    count += !ended.isPredecessor;
  }
  next.tracked.ended.resize(count);
}

void ContactTracker::commit(Contents& kept) noexcept {
  if (!std::exchange(m_keeps, false)) return;
  forEachTracked(
      [](ContactKind, const auto&, auto& tracked) {
        for (TrackedContact& contact : tracked) {
          contact.predecessor.reset();
          ++contact.age;
        }
      },
      kept);
  m_hasGrown = !m_isHeld;
  kept.tracked.ended.clear();
}

void ContactTracker::hold(Contents& before) noexcept {
  if (std::exchange(m_isHeld, true)) return;
  forEachTracked(
      [](ContactKind, auto& contacts, auto& contactsBefore, auto& tracked, auto& trackedBefore) {
        contacts.swap(contactsBefore);
        tracked.swap(trackedBefore);
      },
      m_held, before);
}

void ContactTracker::skip(std::uint64_t step, bool drops, Contents& kept) noexcept {
  if (m_step != step) {
    // Nothing slid or ended in this step.
    forEachTracked(
        [](ContactKind, const auto&, auto& tracked) {
          for (TrackedContact& contact : tracked) contact.predecessor.reset();
        },
        kept);
    kept.tracked.ended.clear();
  }
  if (!drops) return;
  startStep(step, kept);
  hold(kept);
  m_isDropped = true;
}

void ContactTracker::releaseMemory(Contents& contents) {
  forEachTracked([](ContactKind, auto&, auto& tracked) { releaseSpare(tracked); }, contents);
  releaseSpare(contents.tracked.ended);
  if (m_isHeld)
    forEachTracked(
        [](ContactKind, auto& contacts, auto& tracked) {
          releaseSpare(contacts);
          releaseSpare(tracked);
        },
        m_held);
  else
    m_held = {};
}

bool ContactTracker::setUserData(Contents& contents, const ContactKey& key, std::uint64_t data) {
  bool isFound = false;
  const auto place = [](const auto& tracked, const TrackedContact* contact) {
    return static_cast<std::size_t>(contact - tracked.data());
  };
  forEachTracked(
      [&](ContactKind kind, const auto& contacts, const auto& contactsBefore, auto& tracked,
          auto& trackedBefore) {
        if (kind != key.kind) return;
        TrackedContact* const found = findTracked(tracked, key);
        if (!found) return;
        found->userData = data;
        isFound = true;
        if (!m_isHeld) return;
        // Detections of this step that are repeated read it here.
        TrackedContact* const before = findTracked(trackedBefore, key);
        if (before && cornersOf(contactsBefore[place(trackedBefore, before)]) ==
                          cornersOf(contacts[place(tracked, found)]))
          before->userData = data;
      },
      contents, m_held);
  return isFound;
}

}  // namespace palpate
