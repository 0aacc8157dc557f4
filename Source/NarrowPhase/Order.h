#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/NarrowPhase.h"
#include "Core/Assert.h"

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// The sort key of a contact: the ids of its elements; then preferred contacts before others.
class ContactSortKey {
 public:
  /// `second` is below 2^63.
  ContactSortKey(std::uint64_t first, std::uint64_t second, bool isPreferred)
      : m_words{first, second << 1 | (isPreferred ? 0 : 1)} {
    PALPATE_ASSERT(second >> 63 == 0);
  }
  bool isPreferred() const { return (m_words[1] & 1) == 0; }
  bool hasElementsOf(const ContactSortKey& other) const {
    return m_words[0] == other.m_words[0] && m_words[1] >> 1 == other.m_words[1] >> 1;
  }
  bool operator<(const ContactSortKey& other) const { return m_words < other.m_words; }

 private:
  /// The last bit is set if the contact is not preferred. A separate flag makes sorting slower.
  std::array<std::uint64_t, 2> m_words;
};

/// Scratch of the ordering, which remembers its peak.
struct OrderScratch {
  template <class Contact>
  struct Entry {
    ContactSortKey key;
    const Contact* contact;
  };
  Buffer<Entry<VertexTriangleContact>> vertexTriangle;
  Buffer<Entry<EdgeEdgeContact>> edgeEdge;
  Buffer<Entry<ShapeContact>> shape;
  /// For the lists vertexTriangle, triangleVertex and edgeEdge of the last call: which contacts are
  /// from preferred buffers. Empty if there are no such buffers.
  std::array<Buffer<std::uint8_t>, 3> preferred;
};

/// Collects the buffers' contacts, sorted by element ids, each once. The first `preferred` buffers
/// have precedence over the others where both have a contact of the same elements. Returns the
/// number of contacts from preferred buffers.
std::size_t orderContacts(std::span<ContactBuffers* const>, std::size_t preferred, OrderScratch&,
                          CollisionData::Contents&);

}  // namespace palpate
