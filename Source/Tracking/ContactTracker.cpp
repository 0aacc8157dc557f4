#include "Tracking/ContactTracker.h"

#include "NarrowPhase/Filters.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <bit>
#include <type_traits>
#include <utility>

namespace palpate {

namespace {

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

/// The vertices of a feature side by side, for comparisons without branches: no processor predicts
/// which of them are equal.
class FeatureVertices {
 public:
  explicit FeatureVertices(const Triangle& v)
      : m_vertices{v[0], v[1], v[2], 0},
        m_counts{1, v[1] != v[0], v[2] != v[0] && v[2] != v[1], 0} {}
  /// Number of vertices in common with another feature.
  unsigned shared(const Triangle& v) const {
    const auto isIn = (m_vertices == v[0]) | (m_vertices == v[1]) | (m_vertices == v[2]);
    const Lanes counted = reinterpret_cast<Lanes>(isIn) & m_counts;
    return counted[0] + counted[1] + counted[2];
  }

 private:
  using Lanes [[gnu::vector_size(16)]] = std::uint32_t;
  Lanes m_vertices, m_counts;  ///< 1: the vertex comes first
};

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

/// Contacts of both answers grow older. Lists the others in m_ended and m_begun.
void ContactTracker::match(const Contents& last, Contents& next) {
  m_ended.clear();
  m_begun.clear();
  const bool otherElements = hasOtherElements(next);
  const std::uint32_t grown = m_hasGrown ? 0 : 1;
  forEachTracked(
      [&](ContactKind kind, const auto& contactsBefore, const auto& contacts,
          const auto& trackedBefore, auto& tracked) {
        PALPATE_ASSERT(trackedBefore.empty() || trackedBefore.size() == contactsBefore.size());
        tracked.resize(contacts.size());
        const TrackedContact *before = trackedBefore.data(), *const end =
                                                                 before + trackedBefore.size();
        const auto cornersBefore = [&] {
          return cornersOf(contactsBefore[static_cast<std::size_t>(before - trackedBefore.data())]);
        };
        const auto ends = [&] {
          m_ended.push_back({before, verticesOf(before->key, cornersBefore()), false});
          ++before;
        };
        for (std::size_t i = 0; i < contacts.size(); ++i) {
          const ContactKey key = keyOf(kind, contacts[i]);
          const Triangle corners = cornersOf(contacts[i]);
          PALPATE_ASSERT(i == 0 || tracked[i - 1].key < key);
          while (before != end && !areSame(before->key, key) && before->key < key) ends();
          const bool lasts = before != end && areSame(before->key, key) &&
                             areSame(cornersBefore(), corners) &&
                             !(otherElements && kind == ContactKind::Shape);
          // Member by member: a copy of the whole would wait for the stores to its parts.
          TrackedContact& contact = tracked[i];
          contact.key.kind = kind;
          contact.key.ids = key.ids;
          contact.predecessor.reset();
          contact.age = lasts ? before->age + grown : 0;
          contact.userData = lasts ? before->userData : 0;
          contact.end = ContactEnd::None;
          if (lasts)
            ++before;
          else
            m_begun.push_back({&contact, verticesOf(key, corners), false});
        }
        while (before != end) ends();
      },
      before(last), next);
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

/// Links the vertices of contacts that ended: those of the first geometry, with self of both sides.
void ContactTracker::linkVertices(bool self) {
  constexpr std::uint32_t kNone = 0xffffffffu;
  m_links.clear();
  m_heads.assign(std::bit_ceil(4 * m_ended.size()), kNone);
  for (std::uint32_t i = 0; i < m_ended.size(); ++i) {
    const Vertices& vertices = m_ended[i].vertices;
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
  std::size_t count = 0;
  for (std::uint32_t i = 0; i < m_begun.size(); ++i) {
    const Vertices& now = m_begun[i].vertices;
    const FeatureVertices first(now[0]), second(now[1]);
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t vertex = now[0][k];
      if (k > 0 && vertex == now[0][k - 1]) continue;
      std::uint32_t link = m_heads[vertex & (m_heads.size() - 1)];
      for (; link < m_links.size(); link = m_links[link].next) {
        if (m_links[link].vertex != vertex) continue;
        const std::uint32_t entry = m_links[link].entry;
        const Ended& ended = m_ended[entry];
        if (otherElements && ended.contact->key.kind == ContactKind::Shape) continue;
        const auto shared = [&](int side) {
          const unsigned a = first.shared(ended.vertices[side]),
                         b = second.shared(ended.vertices[1 - side]);
          return (a + b) * (static_cast<unsigned>(a > 0) & static_cast<unsigned>(b > 0));
        };
        const unsigned most = std::max(shared(0), self ? shared(1) : 0);
        if (count == m_slides.size()) m_slides.resize(2 * count + m_begun.size());
        m_slides[count] = {i, entry, most};
        count += most > 0;
      }
    }
  }
  m_slides.resize(count);
}

/// Of all pairs of a contact that ended and one that began, takes those with the most common
/// vertices first, then those with the lowest keys. Each contact is in one such pair at most.
void ContactTracker::takePredecessors() {
  constexpr unsigned kMostShared = 6;
  // Those with the most first, in their order.
  std::array<std::size_t, kMostShared + 2> places{};
  for (const Slide& slide : m_slides) ++places[kMostShared - slide.shared + 1];
  for (unsigned i = 0; i <= kMostShared; ++i) places[i + 1] += places[i];
  m_sortedSlides.resize(m_slides.size());
  for (const Slide& slide : m_slides) m_sortedSlides[places[kMostShared - slide.shared]++] = slide;
  for (auto slide = m_sortedSlides.begin(); slide != m_sortedSlides.end();) {
    const auto first = slide;
    std::size_t lowest = m_ended.size();
    for (; slide != m_sortedSlides.end() && slide->begun == first->begun &&
           slide->shared == first->shared;
         ++slide)
      if (!m_ended[slide->entry].isPredecessor)
        lowest = std::min<std::size_t>(lowest, slide->entry);
    Begun& begun = m_begun[first->begun];
    if (lowest == m_ended.size() || begun.hasPredecessor) continue;
    begun.hasPredecessor = true;
    Ended& ended = m_ended[lowest];
    ended.isPredecessor = true;
    begun.contact->predecessor = ended.contact->key;
    begun.contact->age = ageOf(ended) + 1;
    begun.contact->userData = ended.contact->userData;
  }
}

/// Contacts that began in this step keep what an earlier detection of it was given for them.
void ContactTracker::takeUserData(const Contents& last) {
  for (const Begun& begun : m_begun)
    forEachTracked(
        [&](ContactKind kind, const auto& contacts, const auto& tracked) {
          const ContactKey& key = begun.contact->key;
          if (kind != key.kind) return;
          const auto found = std::lower_bound(tracked.begin(), tracked.end(), key, precedes);
          if (found == tracked.end() || found->key != key) return;
          const auto& contact = contacts[static_cast<std::size_t>(found - tracked.begin())];
          if (verticesOf(key, cornersOf(contact)) == begun.vertices)
            begun.contact->userData = found->userData;
        },
        last);
}

ContactEnd ContactTracker::endOf(const MeshPair& pair, bool collides, const Ended& ended) const {
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
                           Contents& next) {
  PALPATE_ASSERT(m_step != kNoStep);
  m_keeps = m_isDropped = false;
  m_elements = elements;
  match(last, next);
  if (!m_isHeld) reserveAs(next);
  if (!m_begun.empty() && !m_ended.empty()) {
    linkVertices(pair.self());
    findSlides(pair.self(), hasOtherElements(next));
    takePredecessors();
  }
  if (std::exchange(m_repeats, true)) takeUserData(last);
  next.tracked.ended.clear();
  const bool hasReasons =
      !collides || pair.predicate || pair.nearAtRest || m_elementsBefore != elements;
  for (const Ended& ended : m_ended) {
    if (ended.isPredecessor) continue;
    const ContactEnd end = hasReasons ? endOf(pair, collides, ended) : ContactEnd::Apart;
    next.tracked.ended.push_back(
        {ended.contact->key, {}, ageOf(ended), ended.contact->userData, end});
  }
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
  m_ended = {};
  m_begun = {};
  m_heads = {};
  m_links = {};
  m_slides = {};
  m_sortedSlides = {};
}

bool ContactTracker::setUserData(Contents& contents, const ContactKey& key, std::uint64_t data) {
  bool isFound = false;
  const auto find = [&](auto& tracked) {
    const auto found = std::lower_bound(tracked.begin(), tracked.end(), key, precedes);
    return found != tracked.end() && found->key == key ? &*found : nullptr;
  };
  const auto place = [](const auto& tracked, const TrackedContact* contact) {
    return static_cast<std::size_t>(contact - tracked.data());
  };
  forEachTracked(
      [&](ContactKind kind, const auto& contacts, const auto& contactsBefore, auto& tracked,
          auto& trackedBefore) {
        if (kind != key.kind) return;
        TrackedContact* const found = find(tracked);
        if (!found) return;
        found->userData = data;
        isFound = true;
        if (!m_isHeld) return;
        // Detections of this step that are repeated read it here.
        TrackedContact* const before = find(trackedBefore);
        if (before && cornersOf(contactsBefore[place(trackedBefore, before)]) ==
                          cornersOf(contacts[place(tracked, found)]))
          before->userData = data;
      },
      contents, m_held);
  return isFound;
}

}  // namespace palpate
