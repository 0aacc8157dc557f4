#include "Tracking/ContactMatch.h"

#include "Exact/WideInteger.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <utility>

namespace palpate {

namespace {

/// The ids of a key as one number, which has their order: it is compared without branches.
UnsignedInt128 numberOf(const ContactKey& key) {
  const auto pair = [&](std::size_t i) { return std::uint64_t{key.ids[i]} << 32 | key.ids[i + 1]; };
  return UnsignedInt128{pair(0)} << 64 | pair(2);
}

/// The vertices of a contact's two features side by side, for comparisons without branches: no
/// processor predicts which of them are equal.
class FeatureVertices {
 public:
  explicit FeatureVertices(const ContactMatch::Vertices& v)
      : m_vertices{lanesOf(v[0]), lanesOf(v[1])},
        m_weights{weightsOf(v[0], 0), weightsOf(v[1], 16)} {}
  /// What another contact has in common with it: in the first byte the number of vertices of the
  /// first feature, in the second byte which of them, in the upper half the same of the second.
  std::uint32_t shared(const Triangle& first, const Triangle& second) const {
    const Lanes sum = (isIn(first, 0) & m_weights[0]) | (isIn(second, 1) & m_weights[1]);
    return sum[0] + sum[1] + sum[2];
  }

 private:
  using Lanes [[gnu::vector_size(16)]] = std::uint32_t;
  static Lanes lanesOf(const Triangle& v) { return Lanes{v[0], v[1], v[2], 0}; }
  /// Of each vertex that is not one of those before it.
  static Lanes weightsOf(const Triangle& v, int shift) {
    return Lanes{0x101, v[1] != v[0] ? 0x201u : 0, v[2] != v[0] && v[2] != v[1] ? 0x401u : 0, 0}
           << shift;
  }
  Lanes isIn(const Triangle& v, int feature) const {
    const Lanes& vertices = m_vertices[feature];
    return reinterpret_cast<Lanes>((vertices == v[0]) | (vertices == v[1]) | (vertices == v[2]));
  }

  std::array<Lanes, 2> m_vertices, m_weights;
};

/// A set that has these vertices and maybe more.
std::uint64_t setOf(const Triangle& vertices) {
  std::uint64_t set = 0;
  for (const std::uint32_t vertex : vertices) set |= std::uint64_t{1} << vertex % 64;
  return set;
}

ContactMatch::Vertices verticesOf(const ContactKey& key, const Triangle& corners) {
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

/// Member by member: a copy of the whole would wait for the stores to its parts.
void write(TrackedContact& contact, const ContactKey& key, std::uint32_t age,
           std::uint64_t userData) {
  contact.key.kind = key.kind;
  contact.key.ids = key.ids;
  contact.predecessor.reset();
  contact.age = age;
  contact.userData = userData;
  contact.end = ContactEnd::None;
}

}  // namespace

void ContactMatch::track(const Contents& before, std::uint32_t steps, bool self, bool otherElements,
                         Contents& next) {
  match(before, steps, otherElements, next);
  if (m_begun.empty() || m_ended.empty()) return;
  linkVertices(self);
  findCandidates();
  findSlides(self, otherElements);
  takePredecessors(steps);
}

/// Contacts of both answers grow older. Lists the others in m_ended and m_begun.
void ContactMatch::match(const Contents& before, std::uint32_t steps, bool otherElements,
                         Contents& next) {
  m_ended.clear();
  m_begun.clear();
  forEachContactList(next, [&](auto kind, const auto&) {
    matchList<kind()>(before, steps, !(otherElements && kind == ContactKind::Shape), next);
  });
}

template <ContactKind kKind>
void ContactMatch::matchList(const Contents& before, std::uint32_t steps, bool mayLast,
                             Contents& next) {
  const auto &contactsBefore = contactList<kKind>(before), &contacts = contactList<kKind>(next);
  const auto& trackedBefore = before.columnsOf(kKind).tracked;
  auto& tracked = next.columnsOf(kKind).tracked;
  PALPATE_ASSERT(trackedBefore.empty() || trackedBefore.size() == contactsBefore.size());
  const std::size_t countBefore = trackedBefore.size(), count = contacts.size();
  tracked.resize(count);
  // Room for all; what is left of it is taken back.
  std::size_t ended = m_ended.size(), begun = m_begun.size();
  const std::size_t firstEnded = ended, firstBegun = begun;
  m_ended.resize(ended + countBefore);
  m_begun.resize(begun + count);
  std::size_t i = 0, j = 0;
  while (i < count && j < countBefore) {
    const ContactKey key = keyOf(kKind, contacts[i]);
    PALPATE_ASSERT(i == 0 || keyOf(kKind, contacts[i - 1]) < key);
    const UnsignedInt128 now = numberOf(key), was = numberOf(trackedBefore[j].key);
    if (now == was && cornersOf(contactsBefore[j]) == cornersOf(contacts[i]) && mayLast) {
      write(tracked[i++], key, trackedBefore[j].age + steps, trackedBefore[j].userData);
      ++j;
      continue;
    }
    // Without branches: no processor predicts where two sorted lists interleave.
    m_ended[ended].contact = &trackedBefore[j];
    m_begun[begun].contact = &tracked[i];
    const bool ends = was <= now, begins = now <= was;
    ended += ends, j += ends;
    begun += begins, i += begins;
  }
  for (; j < countBefore; ++j) m_ended[ended++].contact = &trackedBefore[j];
  for (; i < count; ++i) m_begun[begun++].contact = &tracked[i];
  m_ended.resize(ended);
  m_begun.resize(begun);
  for (std::size_t k = firstEnded; k < ended; ++k) {
    const auto place = static_cast<std::size_t>(m_ended[k].contact - trackedBefore.data());
    m_ended[k].vertices = verticesOf(m_ended[k].contact->key, cornersOf(contactsBefore[place]));
    m_ended[k].isPredecessor = false;
  }
  for (std::size_t k = firstBegun; k < begun; ++k) {
    const auto place = static_cast<std::size_t>(m_begun[k].contact - tracked.data());
    const ContactKey key = keyOf(kKind, contacts[place]);
    write(tracked[place], key, 0, 0);
    m_begun[k].vertices = verticesOf(key, cornersOf(contacts[place]));
    m_begun[k].hasPredecessor = false;
  }
}

/// Lists contacts that ended by the vertices of their first feature, with self of both.
void ContactMatch::linkVertices(bool self) {
  m_lists.assign(std::bit_ceil(4 * m_ended.size()), kNoLink);
  m_links.resize((self ? 6 : 3) * m_ended.size() + 1);
  m_links[kNoLink] = {0, 0, kNoLink};
  std::uint32_t count = 1;
  for (std::uint32_t i = 0; i < m_ended.size(); ++i) {
    const Vertices& vertices = m_ended[i].vertices;
    for (int side = 0; side < (self ? 2 : 1); ++side) {
      const std::uint64_t others = setOf(vertices[1 - side]);
      for (int k = 0; k < 3; ++k) {
        const std::uint32_t vertex = vertices[side][k];
        if (k > 0 && vertex == vertices[side][k - 1]) continue;
        std::uint32_t& list = m_lists[vertex & (m_lists.size() - 1)];
        m_links[count] = {others, i, std::exchange(list, count)};
        ++count;
      }
    }
  }
}

/// Lists for each contact that began those that ended and probably have common vertices with it on
/// both sides.
void ContactMatch::findCandidates() {
  constexpr std::size_t kOfOne = 6;  // at most, beside those of long lists
  const Link* const links = m_links.data();
  const std::size_t lastList = m_lists.size() - 1;
  std::size_t count = 0;
  const auto makeRoom = [&](std::size_t more) {
    if (count + more > m_candidates.size())
      m_candidates.resize(2 * count + kOfOne * m_begun.size() + more);
    return m_candidates.data() + count;
  };
  for (std::uint32_t i = 0; i < m_begun.size(); ++i) {
    const Vertices& now = m_begun[i].vertices;
    const std::uint64_t others = setOf(now[1]);
    Candidate* candidate = makeRoom(kOfOne);
    const auto countAll = [&] {
      count = static_cast<std::size_t>(candidate - m_candidates.data());
    };
    for (unsigned k = 0; k < 3; ++k) {
      if (k > 0 && now[0][k] == now[0][k - 1]) continue;
      std::uint32_t link = m_lists[now[0][k] & lastList];
      const auto take = [&] {
        *candidate = {i, links[link].entry, k};
        candidate += (links[link].others & others) != 0;
        link = links[link].next;
      };
      // No processor predicts how long a list is, but most have no more than two.
      take();
      take();
      while (link != kNoLink) {
        countAll();
        candidate = makeRoom(kOfOne);
        take();
      }
    }
    countAll();
  }
  m_candidates.resize(count);
}

/// Of the candidates, those with common vertices on both sides, each once.
void ContactMatch::findSlides(bool self, bool otherElements) {
  m_slides.resize(m_candidates.size());
  std::size_t count = 0;
  for (const auto& [i, entry, vertex] : m_candidates) {
    const Ended& ended = m_ended[entry];
    if (otherElements && ended.contact->key.kind == ContactKind::Shape) continue;
    const FeatureVertices vertices(m_begun[i].vertices);
    std::uint32_t which = 0;
    const auto shared = [&](int side) {
      const std::uint32_t found = vertices.shared(ended.vertices[side], ended.vertices[1 - side]);
      const std::uint32_t a = found & 0xff, b = found >> 16 & 0xff;
      const std::uint32_t isSlide = static_cast<unsigned>(a > 0) & static_cast<unsigned>(b > 0);
      which |= found * isSlide;
      return (a + b) * isSlide;
    };
    const unsigned most = std::max(shared(0), self ? shared(1) : 0);
    // The list of another vertex may have it, too.
    const bool isFirst = (which >> 8 & ((1u << vertex) - 1)) == 0;
    m_slides[count] = {i, entry, most};
    count += static_cast<unsigned>(most > 0) & static_cast<unsigned>(isFirst);
  }
  m_slides.resize(count);
}

/// Of all pairs of a contact that ended and one that began, takes those with the most common
/// vertices first, then those with the lowest keys. Each contact is in one such pair at most.
void ContactMatch::takePredecessors(std::uint32_t steps) {
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
    begun.contact->age = ended.contact->age + steps;
    begun.contact->userData = ended.contact->userData;
  }
}

void ContactMatch::takeUserData(std::span<const Given> given, bool ofSecond) {
  if (given.empty()) return;
  for (const Begun& begun : m_begun) {
    const ContactKey& key = begun.contact->key;
    auto found = placeOf(given, key);
    for (; found != given.end() && found->key == key; ++found)
      if (verticesOf(key, found->corners) == begun.vertices &&
          found->ofSecond == (ofSecond && key.kind == ContactKind::Shape))
        begun.contact->userData = found->userData;
  }
}

}  // namespace palpate
