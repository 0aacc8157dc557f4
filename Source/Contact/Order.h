#pragma once

#include <palpate/CollisionData.h>

#include "Contact/ContactBuffers.h"
#include "Contact/Contents.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// The sort key of a contact: the ids of its key; then preferred contacts before others. Keys of
/// one kind only are compared.
class ContactSortKey {
 public:
  ContactSortKey(const ContactKey& key, bool isPreferred)
      : m_words{packed(key.ids[0], key.ids[1]),
                packed(key.ids[2], key.ids[3]) << 1 | (isPreferred ? 0 : 1)} {
    PALPATE_ASSERT(key.ids[2] >> 31 == 0 || key.ids[2] == kNoElement);
  }
  bool isPreferred() const { return (m_words[1] & 1) == 0; }
  bool hasElementsOf(const ContactSortKey& other) const {
    return m_words[0] == other.m_words[0] && m_words[1] >> 1 == other.m_words[1] >> 1;
  }
  bool operator<(const ContactSortKey& other) const { return m_words < other.m_words; }

 private:
  static std::uint64_t packed(std::uint32_t first, std::uint32_t second) {
    return std::uint64_t{first} << 32 | second;
  }

  /// The last bit is set if the contact is not preferred. A separate flag makes sorting slower. The
  /// first bit of the third id gives way to it: ids are below 2^28, or unused in all keys of a
  /// kind.
  std::array<std::uint64_t, 2> m_words;
};

/// Scratch of the ordering, which remembers its peak.
struct OrderScratch {
  struct Entry {
    ContactSortKey key;
    const void* contact;
  };
  Buffer<Entry> entries;
  /// For each list of contacts between meshes of the last call: which contacts are from preferred
  /// buffers. Empty if there are no such buffers.
  std::array<Buffer<std::uint8_t>, 3> preferred;
};

/// Collects the buffers' contacts, sorted by their keys, each once. The first `preferred` buffers
/// have precedence over the others where both have a contact of the same key. Returns the number of
/// contacts from preferred buffers.
std::size_t orderContacts(std::span<ContactBuffers* const>, std::size_t preferred, OrderScratch&,
                          CollisionData::Contents&);

}  // namespace palpate
