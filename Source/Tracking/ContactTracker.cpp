#include "Tracking/ContactTracker.h"

#include "Contact/Filters.h"
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
  m_given.clear();
  if (std::exchange(m_isDropped, false)) return true;
  m_isHeld = m_hasGrown = false;
  m_beforeOfSecond = last.trackedOfSecond;
  m_elementsBefore = m_elements;
  return true;
}

bool ContactTracker::hadContacts(const Contents& last) const {
  const auto& columns = before(last).columns;
  return std::any_of(columns.begin(), columns.end(),
                     [](const Contents::Columns& each) { return !each.tracked.empty(); });
}

/// Answers take turns with m_held. Their lists soon have the capacity of the largest one.
void ContactTracker::reserveAs(const Contents& next) {
  const auto reserve = [](const auto& list, auto& spare) {
    if (spare.capacity() >= list.capacity()) return;
    spare.clear();
    spare.reserve(list.capacity());
  };
  forEachContactList(next, [&](auto kind, const auto& contacts) {
    reserve(contacts, contactList<kind()>(m_held));
  });
  for (std::size_t i = 0; i < next.columns.size(); ++i)
    reserve(next.columns[i].tracked, m_held.columns[i].tracked);
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
  scratch.takeUserData(m_given, next.trackedOfSecond);
  const bool hasReasons =
      !collides || pair.predicate || pair.nearAtRest || m_elementsBefore != elements;
  next.ended.resize(scratch.ended().size());
  std::size_t count = 0;
  for (const ContactMatch::Ended& ended : scratch.ended()) {
    TrackedContact& contact = next.ended[count];
    contact.key.kind = ended.contact->key.kind;
    contact.key.ids = ended.contact->key.ids;
    contact.predecessor.reset();
    contact.age = ended.contact->age - grown;
    contact.userData = ended.contact->userData;
    contact.end = ContactEnd::Apart;
    if (hasReasons && !ended.isPredecessor) contact.end = endOf(pair, collides, ended);
    count += !ended.isPredecessor;
  }
  next.ended.resize(count);
}

void ContactTracker::commit(Contents& kept) noexcept {
  if (!std::exchange(m_keeps, false)) return;
  for (Contents::Columns& each : kept.columns)
    for (TrackedContact& contact : each.tracked) {
      contact.predecessor.reset();
      ++contact.age;
    }
  m_hasGrown = !m_isHeld;
  kept.ended.clear();
}

void ContactTracker::hold(Contents& before) noexcept {
  if (std::exchange(m_isHeld, true)) return;
  forEachContactList(
      before, [&](auto kind, auto& contacts) { contactList<kind()>(m_held).swap(contacts); });
  for (std::size_t i = 0; i < before.columns.size(); ++i)
    m_held.columns[i].tracked.swap(before.columns[i].tracked);
}

void ContactTracker::skip(std::uint64_t step, bool drops, Contents& kept) noexcept {
  if (m_step != step) {
    // Nothing slid or ended in this step.
    for (Contents::Columns& each : kept.columns)
      for (TrackedContact& contact : each.tracked) contact.predecessor.reset();
    kept.ended.clear();
  }
  if (!drops) return;
  startStep(step, kept);
  hold(kept);
  m_isDropped = true;
}

void ContactTracker::releaseMemory() {
  if (!m_isHeld) m_held = {};
  m_held.releaseSpare();
  releaseSpare(m_given);
}

bool ContactTracker::setUserData(Contents& contents, const ContactKey& key, std::uint64_t data) {
  if (key.kind > ContactKind::ShapeShape) return false;
  auto &tracked = contents.columnsOf(key.kind).tracked,
       &trackedBefore = m_held.columnsOf(key.kind).tracked;
  TrackedContact* const found = findTracked(tracked, key);
  if (!found) return false;
  if (m_isHeld) {
    // Detections of this step that are repeated read it here.
    const bool isOfShape = key.kind == ContactKind::Shape;
    const ContactMatch::Given given{
        key, cornersAt(contents, key.kind, static_cast<std::size_t>(found - tracked.data())),
        isOfShape && contents.trackedOfSecond, data};
    TrackedContact* const before = findTracked(trackedBefore, key);
    if (before && given.ofSecond == (isOfShape && m_beforeOfSecond) &&
        cornersAt(m_held, key.kind, static_cast<std::size_t>(before - trackedBefore.data())) ==
            given.corners)
      before->userData = data;
    else
      give(given);
  }
  found->userData = data;
  return true;
}

void ContactTracker::give(const ContactMatch::Given& given) {
  auto place = ContactMatch::placeOf(m_given, given.key);
  for (; place != m_given.end() && place->key == given.key; ++place)
    if (place->isOf(given)) {
      place->userData = given.userData;
      return;
    }
  m_given.insert(place, given);
}

}  // namespace palpate
