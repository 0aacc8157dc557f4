#include "Contact/Order.h"

#include "Contact/ContactLists.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <functional>

namespace palpate {

namespace {

/// Sorts the buffers' contacts of one kind, each once, into `out`. The scratch then has their
/// entries.
template <ContactKind kKind, class Contact>
void order(std::span<ContactBuffers* const> buffers, std::size_t preferred, OrderScratch& scratch,
           CountedVector<Contact>& out) {
  TimeCheck check(256);
  auto& entries = scratch.entries;
  std::size_t size = 0;
  for (const ContactBuffers* found : buffers) size += contactList<kKind>(*found).size();
  entries.clear();
  if (size > entries.capacity()) entries.reserve(size + size / 8);
  for (std::size_t i = 0; i < buffers.size(); ++i)
    for (const Contact& contact : contactList<kKind>(*buffers[i])) {
      check();
      entries.push_back({ContactSortKey(keyOf(kKind, contact), i < preferred), &contact});
    }
  sortInTime(entries.begin(), entries.end(),
             [](const auto& l, const auto& r) { return l.key < r.key; });
  entries.erase(std::unique(entries.begin(), entries.end(),
                            [&](const auto& l, const auto& r) {
                              check();
                              return l.key.hasElementsOf(r.key);
                            }),
                entries.end());
  out.clear();
  out.reserve(entries.size());
  for (const auto& entry : entries) {
    check();
    out.push_back(*static_cast<const Contact*>(entry.contact));
  }
}

}  // namespace

std::size_t orderContacts(std::span<ContactBuffers* const> buffers, std::size_t preferred,
                          OrderScratch& scratch, CollisionData::Contents& out) {
  PALPATE_ASSERT(preferred <= buffers.size());
  std::size_t count = 0;
  forEachContactList(out, [&](auto kind, auto& list) {
    order<kind()>(buffers, preferred, scratch, list);
    if constexpr (kind <= ContactKind::EdgeEdge) {
      auto& flags = scratch.preferred[static_cast<std::size_t>(kind())];
      flags.clear();
      if (preferred == 0) return;
      TimeCheck check(1024);
      for (const auto& entry : scratch.entries) {
        check();
        flags.push_back(entry.key.isPreferred());
        count += entry.key.isPreferred();
      }
    }
  });
  auto& triangles = out.intersectingTriangles;
  triangles.clear();
  for (const ContactBuffers* buffer : buffers)
    triangles.insert(triangles.end(), buffer->intersectingTriangles.begin(),
                     buffer->intersectingTriangles.end());
  sortInTime(triangles.begin(), triangles.end(), std::less<>());
  triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
  return count;
}

}  // namespace palpate
