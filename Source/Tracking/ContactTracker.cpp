#include "Tracking/ContactTracker.h"

#include "NarrowPhase/Filters.h"
#include "Core/Assert.h"

#include <algorithm>
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
ContactTracker::Vertices ContactTracker::verticesOf(ContactKind kind, const Contact& contact) {
  constexpr Triangle kNone{kNoElement, kNoElement, kNoElement};
  if constexpr (std::is_same_v<Contact, VertexTriangleContact>) {
    const Triangle vertex{contact.vertex, contact.vertex, contact.vertex};
    if (kind == ContactKind::TriangleVertex) return {contact.vertices, vertex};
    return {vertex, contact.vertices};
  } else if constexpr (std::is_same_v<Contact, EdgeEdgeContact>) {
    const Segment &a = contact.edgeA, &b = contact.edgeB;
    return {{{a[0], a[1], a[1]}, {b[0], b[1], b[1]}}};
  } else if constexpr (std::is_same_v<Contact, ShapeContact>) {
    return {contact.vertices, kNone};
  } else {
    return {kNone, kNone};
  }
}

bool ContactTracker::startStep(std::uint64_t step, const Contents& last) {
  if (m_step == step) return false;
  m_step = kNoStep;
  m_before.clear();
  forEachTracked(last, [&](ContactKind kind, const auto& contacts, const auto& tracked) {
    PALPATE_ASSERT(tracked.empty() || tracked.size() == contacts.size());
    for (std::size_t i = 0; i < tracked.size(); ++i)
      m_before.push_back({tracked[i], verticesOf(kind, contacts[i]), false});
  });
  m_beforeOfSecond = last.tracked.elementsOfSecond;
  m_step = step;
  return true;
}

/// Contacts of both answers grow older. Lists the others in m_ended and m_begun.
void ContactTracker::match(Contents& next) {
  m_ended.clear();
  m_begun.clear();
  Entry *before = m_before.data(), *const end = before + m_before.size();
  forEachTracked(next, [&](ContactKind kind, const auto& contacts, auto& tracked) {
    tracked.resize(contacts.size());
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const ContactKey key = keyOf(kind, contacts[i]);
      PALPATE_ASSERT(i == 0 || tracked[i - 1].key < key);
      const Vertices vertices = verticesOf(kind, contacts[i]);
      for (; before != end && before->contact.key < key; ++before) m_ended.push_back(before);
      tracked[i] = {};
      tracked[i].key = key;
      if (before == end || before->contact.key != key || before->vertices != vertices) {
        m_begun.push_back({&tracked[i], vertices});
        continue;
      }
      tracked[i].age = before->contact.age + 1;
      tracked[i].userData = before->contact.userData;
      ++before;
    }
  });
  for (; before != end; ++before) m_ended.push_back(before);
}

/// Names the predecessors of contacts that began: of all pairs of one that ended and one that began
/// whose features have common vertices on both sides, those with the most such vertices first, then
/// the lowest keys. Each contact is in one such pair at most.
void ContactTracker::findSlides(bool self) {
  for (Entry* entry : m_ended) entry->isPredecessor = false;
  if (m_begun.empty() || m_ended.empty()) return;
  m_vertices.clear();
  for (std::uint32_t i = 0; i < m_ended.size(); ++i)
    for (int side = 0; side < (self ? 2 : 1); ++side)
      for (const std::uint32_t v : m_ended[i]->vertices[side]) m_vertices.push_back({v, i});
  std::sort(m_vertices.begin(), m_vertices.end());
  m_vertices.erase(std::unique(m_vertices.begin(), m_vertices.end()), m_vertices.end());
  m_slides.clear();
  for (std::uint32_t i = 0; i < m_begun.size(); ++i) {
    const Vertices& now = m_begun[i].vertices;
    for (int k = 0; k < 3; ++k) {
      if (k > 0 && now[0][k] == now[0][k - 1]) continue;
      auto at = std::lower_bound(m_vertices.begin(), m_vertices.end(), VertexOf{now[0][k], 0});
      for (; at != m_vertices.end() && at->vertex == now[0][k]; ++at) {
        const Vertices& before = m_ended[at->entry]->vertices;
        const auto shared = [&](int first) {
          const int a = sharedVertices(now[0], before[first]),
                    b = sharedVertices(now[1], before[1 - first]);
          return a > 0 && b > 0 ? a + b : 0;
        };
        const int most = std::max(shared(0), self ? shared(1) : 0);
        if (most > 0) m_slides.push_back({most, i, at->entry});
      }
    }
  }
  std::sort(m_slides.begin(), m_slides.end(), [](const Slide& l, const Slide& r) {
    if (l.shared != r.shared) return l.shared > r.shared;
    return l.begun != r.begun ? l.begun < r.begun : l.entry < r.entry;
  });
  for (const Slide& slide : m_slides) {
    TrackedContact& contact = *m_begun[slide.begun].contact;
    Entry& entry = *m_ended[slide.entry];
    if (contact.predecessor || entry.isPredecessor) continue;
    entry.isPredecessor = true;
    contact.predecessor = entry.contact.key;
    contact.age = entry.contact.age + 1;
    contact.userData = entry.contact.userData;
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
      if (verticesOf(kind, contact) == begun.vertices) begun.contact->userData = found->userData;
    });
}

ContactEnd ContactTracker::endOf(const MeshPair& pair, bool collides, const Entry& entry) const {
  const auto& [kind, ids] = entry.contact.key;
  const auto& [ofA, ofB] = entry.vertices;
  const MeshTopology &a = pair.a.topology, &b = pair.b.topology;
  ContactEnd end = ContactEnd::None;
  bool filtered = !collides;
  switch (kind) {
    case ContactKind::VertexTriangle:
      end = firstOf(endOfVertex(a, ids[0]), endOfElement(b, ids[1], ofB));
      if (end == ContactEnd::None)
        filtered = filtered || rejectsVertex(pair, ids[0], ids[1], false);
      break;
    case ContactKind::TriangleVertex:
      end = firstOf(endOfElement(a, ids[0], ofA), endOfVertex(b, ids[1]));
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
          end = endOfElement(mesh, ids[1], ofA);
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

void ContactTracker::track(const MeshPair& pair, bool collides, const Contents& last,
                           Contents& next) {
  PALPATE_ASSERT(m_step != kNoStep);
  m_keeps = false;
  match(next);
  findSlides(pair.self());
  takeUserData(last);
  next.tracked.ended.clear();
  for (const Entry* entry : m_ended) {
    if (entry->isPredecessor) continue;
    next.tracked.ended.push_back(entry->contact);
    next.tracked.ended.back().end = endOf(pair, collides, *entry);
  }
}

void ContactTracker::commit(Contents& kept) noexcept {
  if (!std::exchange(m_keeps, false)) return;
  const Entry* before = m_before.data();
  forEachTracked(kept, [&](ContactKind, const auto&, auto& tracked) {
    for (TrackedContact& contact : tracked) {
      contact.predecessor.reset();
      contact.age = before++->contact.age + 1;
    }
  });
  PALPATE_ASSERT(before == m_before.data() + m_before.size());
  kept.tracked.ended.clear();
}

void ContactTracker::releaseMemory(Contents& contents) {
  forEachTracked(contents, [](ContactKind, auto&, auto& tracked) { releaseSpare(tracked); });
  releaseSpare(contents.tracked.ended);
  releaseSpare(m_before);
  m_ended = {};
  m_begun = {};
  m_vertices = {};
  m_slides = {};
}

bool ContactTracker::setUserData(Contents& contents, const ContactKey& key, std::uint64_t data) {
  bool isFound = false;
  const auto set = [&](TrackedContact* contact) {
    contact->userData = data;
    isFound = true;
  };
  forEachTracked(contents, [&](ContactKind kind, const auto&, auto& tracked) {
    if (kind != key.kind) return;
    const auto found = std::lower_bound(tracked.begin(), tracked.end(), key, precedes);
    if (found != tracked.end() && found->key == key) set(&*found);
  });
  if (!isFound) return false;
  // Detections of this step that are repeated read it here.
  const auto found =
      std::lower_bound(m_before.begin(), m_before.end(), key,
                       [](const Entry& e, const ContactKey& k) { return e.contact.key < k; });
  if (found != m_before.end() && found->contact.key == key) set(&found->contact);
  return true;
}

}  // namespace palpate
