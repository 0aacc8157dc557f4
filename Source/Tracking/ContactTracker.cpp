#include "Tracking/ContactTracker.h"

#include "NarrowPhase/Filters.h"
#include "Core/Assert.h"

#include <algorithm>
#include <bit>
#include <type_traits>
#include <utility>

namespace palpate {

namespace {

/// Calls f(kind, contacts, tracked) for each list, in the order of keys.
template <class Contents, class F>
void forEachTracked(Contents& contents, F&& f) {
  auto& tracked = contents.tracked;
  f(ContactKind::VertexTriangle, contents.vertexTriangle, tracked.vertexTriangle);
  f(ContactKind::TriangleVertex, contents.triangleVertex, tracked.triangleVertex);
  f(ContactKind::EdgeEdge, contents.edgeEdge, tracked.edgeEdge);
  f(ContactKind::Shape, contents.shape, tracked.shape);
  f(ContactKind::ShapeShape, contents.shapeShape, tracked.shapeShape);
}

bool precedes(const TrackedContact& contact, const ContactKey& key) { return contact.key < key; }

/// Comparison of few numbers without a call, as most contacts last.
template <std::size_t N>
bool areSame(const std::array<std::uint32_t, N>& a, const std::array<std::uint32_t, N>& b) {
  std::uint32_t difference = 0;
  for (std::size_t i = 0; i < N; ++i) difference |= a[i] ^ b[i];
  return difference == 0;
}
bool areSame(const ContactKey& a, const ContactKey& b) {
  return a.kind == b.kind && areSame(a.ids, b.ids);
}

/// Number of vertices that two features have in common.
int sharedVertices(const Triangle& a, const Triangle& b) {
  int shared = 0;
  for (int i = 0; i < 3; ++i) {
    const bool isNew = (i < 1 || a[i] != a[0]) && (i < 2 || a[i] != a[1]);
    shared += isNew && (a[i] == b[0] || a[i] == b[1] || a[i] == b[2]);
  }
  return shared;
}

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

template <class Contact>
ContactKey ContactTracker::keyOf(ContactKind kind, const Contact& contact) {
  ContactKey key{kind};
  auto& ids = key.ids;
  if constexpr (std::is_same_v<Contact, VertexTriangleContact>) {
    ids[0] = contact.vertex, ids[1] = contact.triangle;
    if (kind == ContactKind::TriangleVertex) std::swap(ids[0], ids[1]);
  } else if constexpr (std::is_same_v<Contact, EdgeEdgeContact>) {
    ids = {contact.edgeA[0], contact.edgeA[1], contact.edgeB[0], contact.edgeB[1]};
  } else if constexpr (std::is_same_v<Contact, ShapeContact>) {
    ids = {static_cast<std::uint32_t>(contact.element), contact.id, contact.vertices[1],
           contact.vertices[2]};
  }
  return key;
}

template <class Contact>
Triangle ContactTracker::cornersOf(const Contact& contact) {
  if constexpr (requires { contact.vertices; })
    return contact.vertices;
  else
    return {};
}

ContactTracker::Vertices ContactTracker::verticesOf(const ContactKey& key,
                                                    const Triangle& corners) {
  constexpr Triangle kNone{kNoElement, kNoElement, kNoElement};
  const auto& ids = key.ids;
  switch (key.kind) {
    case ContactKind::VertexTriangle:
      return {{{ids[0], ids[0], ids[0]}, corners}};
    case ContactKind::TriangleVertex:
      return {{corners, {ids[1], ids[1], ids[1]}}};
    case ContactKind::EdgeEdge:
      return {{{ids[0], ids[1], ids[1]}, {ids[2], ids[3], ids[3]}}};
    case ContactKind::Shape:
      return {corners, kNone};
    case ContactKind::ShapeShape:
      break;
  }
  return {kNone, kNone};
}

bool ContactTracker::startStep(std::uint64_t step, const Contents& last) {
  if (m_step == step) return false;
  if (m_isDropped) {
    m_isDropped = m_repeats = false;
    m_step = step;
    return true;
  }
  m_step = kNoStep;
  m_before.clear();
  forEachTracked(last, [&](ContactKind, const auto& contacts, const auto& tracked) {
    PALPATE_ASSERT(tracked.empty() || tracked.size() == contacts.size());
    const std::size_t first = m_before.size();
    m_before.resize(first + tracked.size());
    for (std::size_t i = 0; i < tracked.size(); ++i)
      m_before[first + i] = {tracked[i].key, cornersOf(contacts[i]), tracked[i].age, false,
                             tracked[i].userData};
  });
  m_beforeOfSecond = last.tracked.elementsOfSecond;
  m_elementsBefore = m_elements;
  m_repeats = false;
  m_step = step;
  return true;
}

/// Contacts of both answers grow older. Lists the others in m_ended and m_begun.
void ContactTracker::match(Contents& next) {
  m_ended.clear();
  m_begun.clear();
  Entry *before = m_before.data(), *const end = before + m_before.size();
  const bool otherElements = hasOtherElements(next);
  forEachTracked(next, [&](ContactKind kind, const auto& contacts, auto& tracked) {
    tracked.resize(contacts.size());
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const ContactKey key = keyOf(kind, contacts[i]);
      const Triangle corners = cornersOf(contacts[i]);
      PALPATE_ASSERT(i == 0 || tracked[i - 1].key < key);
      while (before != end && !areSame(before->key, key) && before->key < key)
        m_ended.push_back(before++);
      if (before != end && areSame(before->key, key) && areSame(before->corners, corners) &&
          !(otherElements && kind == ContactKind::Shape)) {
        tracked[i] = {key, {}, before->age + 1, before->userData, ContactEnd::None};
        ++before;
      } else {
        tracked[i] = {key, {}, 0, 0, ContactEnd::None};
        m_begun.push_back({&tracked[i], corners, 0});
      }
    }
  });
  for (; before != end; ++before) m_ended.push_back(before);
}

/// Links the vertices of contacts that ended: those of the first geometry, with self of both sides.
void ContactTracker::linkVertices(bool self) {
  constexpr std::uint32_t kNone = 0xffffffffu;
  m_links.clear();
  m_heads.assign(std::bit_ceil(4 * m_ended.size()), kNone);
  for (std::uint32_t i = 0; i < m_ended.size(); ++i) {
    const Vertices vertices = verticesOf(m_ended[i]->key, m_ended[i]->corners);
    for (int side = 0; side < (self ? 2 : 1); ++side)
      for (int k = 0; k < 3; ++k) {
        const std::uint32_t vertex = vertices[side][k];
        if (k > 0 && vertex == vertices[side][k - 1]) continue;
        std::uint32_t& head = m_heads[vertex & (m_heads.size() - 1)];
        m_links.push_back(
            {vertex, i, std::exchange(head, static_cast<std::uint32_t>(m_links.size()))});
      }
  }
}

/// Lists for each contact that began those that ended and have common vertices with it on both
/// sides.
void ContactTracker::findSlides(bool self, bool otherElements) {
  m_slides.clear();
  for (Begun& begun : m_begun) {
    begun.firstSlide = m_slides.size();
    const Vertices now = verticesOf(begun.contact->key, begun.corners);
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t vertex = now[0][k];
      if (k > 0 && vertex == now[0][k - 1]) continue;
      std::uint32_t link = m_heads[vertex & (m_heads.size() - 1)];
      for (; link < m_links.size(); link = m_links[link].next) {
        if (m_links[link].vertex != vertex) continue;
        const Entry& entry = *m_ended[m_links[link].entry];
        if (otherElements && entry.key.kind == ContactKind::Shape) continue;
        const Vertices before = verticesOf(entry.key, entry.corners);
        const auto shared = [&](int first) {
          const int a = sharedVertices(now[0], before[first]),
                    b = sharedVertices(now[1], before[1 - first]);
          return a > 0 && b > 0 ? a + b : 0;
        };
        const int most = std::max(shared(0), self ? shared(1) : 0);
        if (most > 0) m_slides.push_back({m_links[link].entry, most});
      }
    }
  }
}

/// Of all pairs of a contact that ended and one that began, takes those with the most common
/// vertices first, then those with the lowest keys. Each contact is in one such pair at most.
void ContactTracker::takePredecessors() {
  constexpr int kMostShared = 6;
  for (int shared = kMostShared; shared >= 2; --shared)
    for (std::size_t i = 0; i < m_begun.size(); ++i) {
      TrackedContact& contact = *m_begun[i].contact;
      if (contact.predecessor) continue;
      const std::size_t end = i + 1 < m_begun.size() ? m_begun[i + 1].firstSlide : m_slides.size();
      std::size_t lowest = m_ended.size();
      for (std::size_t s = m_begun[i].firstSlide; s < end; ++s)
        if (m_slides[s].shared == shared && !m_ended[m_slides[s].entry]->isPredecessor)
          lowest = std::min<std::size_t>(lowest, m_slides[s].entry);
      if (lowest == m_ended.size()) continue;
      Entry& entry = *m_ended[lowest];
      entry.isPredecessor = true;
      contact.predecessor = entry.key;
      contact.age = entry.age + 1;
      contact.userData = entry.userData;
    }
}

/// Contacts that began in this step keep what an earlier detection of it was given for them.
void ContactTracker::takeUserData(const Contents& last) {
  for (const Begun& begun : m_begun)
    forEachTracked(last, [&](ContactKind kind, const auto& contacts, const auto& tracked) {
      const ContactKey& key = begun.contact->key;
      if (kind != key.kind) return;
      const auto found = std::lower_bound(tracked.begin(), tracked.end(), key, precedes);
      if (found == tracked.end() || found->key != key) return;
      const auto& contact = contacts[static_cast<std::size_t>(found - tracked.begin())];
      if (cornersOf(contact) == begun.corners) begun.contact->userData = found->userData;
    });
}

ContactEnd ContactTracker::endOf(const MeshPair& pair, bool collides, const Entry& entry) const {
  const auto& [kind, ids] = entry.key;
  const MeshTopology &a = pair.a.topology, &b = pair.b.topology;
  ContactEnd end = ContactEnd::None;
  bool filtered = !collides;
  switch (kind) {
    case ContactKind::VertexTriangle:
      end = firstOf(endOfVertex(a, ids[0]), endOfElement(b, ids[1], entry.corners));
      if (end == ContactEnd::None)
        filtered = filtered || rejectsVertex(pair, ids[0], ids[1], false);
      break;
    case ContactKind::TriangleVertex:
      end = firstOf(endOfElement(a, ids[0], entry.corners), endOfVertex(b, ids[1]));
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
          end = endOfElement(mesh, ids[1], entry.corners);
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
                           Contents& next) {
  PALPATE_ASSERT(m_step != kNoStep);
  m_keeps = m_isDropped = false;
  m_elements = elements;
  match(next);
  for (Entry* entry : m_ended) entry->isPredecessor = false;
  if (!m_begun.empty() && !m_ended.empty()) {
    linkVertices(pair.self());
    findSlides(pair.self(), hasOtherElements(next));
    takePredecessors();
  }
  if (std::exchange(m_repeats, true)) takeUserData(last);
  next.tracked.ended.clear();
  const bool hasReasons =
      !collides || pair.predicate || pair.nearAtRest || m_elementsBefore != elements;
  for (const Entry* entry : m_ended) {
    if (entry->isPredecessor) continue;
    const ContactEnd end = hasReasons ? endOf(pair, collides, *entry) : ContactEnd::Apart;
    next.tracked.ended.push_back({entry->key, {}, entry->age, entry->userData, end});
  }
}

void ContactTracker::commit(Contents& kept) noexcept {
  if (!std::exchange(m_keeps, false)) return;
  const Entry* before = m_before.data();
  forEachTracked(kept, [&](ContactKind, const auto&, auto& tracked) {
    for (TrackedContact& contact : tracked) {
      contact.predecessor.reset();
      contact.age = before++->age + 1;
    }
  });
  PALPATE_ASSERT(before == m_before.data() + m_before.size());
  kept.tracked.ended.clear();
}

void ContactTracker::skip(std::uint64_t step, bool drops, Contents& kept) {
  if (m_step != step) {
    // Nothing slid or ended in this step.
    forEachTracked(kept, [](ContactKind, const auto&, auto& tracked) {
      for (TrackedContact& contact : tracked) contact.predecessor.reset();
    });
    kept.tracked.ended.clear();
  }
  if (!drops) return;
  startStep(step, kept);
  m_isDropped = true;
}

void ContactTracker::releaseMemory(Contents& contents) {
  forEachTracked(contents, [](ContactKind, auto&, auto& tracked) { releaseSpare(tracked); });
  releaseSpare(contents.tracked.ended);
  releaseSpare(m_before);
  m_ended = {};
  m_begun = {};
  m_heads = {};
  m_links = {};
  m_slides = {};
}

bool ContactTracker::setUserData(Contents& contents, const ContactKey& key, std::uint64_t data) {
  bool isFound = false;
  forEachTracked(contents, [&](ContactKind kind, const auto& contacts, auto& tracked) {
    if (kind != key.kind) return;
    const auto found = std::lower_bound(tracked.begin(), tracked.end(), key, precedes);
    if (found == tracked.end() || found->key != key) return;
    found->userData = data;
    isFound = true;
    // Detections of this step that are repeated read it here.
    const auto before =
        std::lower_bound(m_before.begin(), m_before.end(), key,
                         [](const Entry& e, const ContactKey& k) { return e.key < k; });
    if (before != m_before.end() && before->key == key &&
        before->corners == cornersOf(contacts[static_cast<std::size_t>(found - tracked.begin())]))
      before->userData = data;
  });
  return isFound;
}

}  // namespace palpate
