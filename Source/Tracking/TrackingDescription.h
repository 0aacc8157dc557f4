#pragma once

#include "Tracking/ContactTracker.h"
#include "Tracking/SideMemory.h"
#include "Core/Archive.h"

#include <algorithm>
#include <cstddef>

namespace palpate {

namespace description {
template <class File>
void contactKeyOf(File& file, ContactKey& key) {
  enumeratorOf(file, key.kind, ContactKind::ShapeShape);
  fieldOf(file, key.ids);
}
}  // namespace description

template <class File>
void ContactTracker::describe(File& file, const auto& revisions, const Contents& kept,
                              bool isCurrent) {
  using namespace description;
  file.integer(m_step);
  /// A contact at the last advance(). corners: of the element that key does not describe; else 0.
  struct Entry {
    ContactKey key;
    Triangle corners;
    std::uint32_t age;
    std::uint64_t userData;
  };
  std::vector<Entry> entries;
  if constexpr (!File::kReads)
    if (m_step != kNoStep)
      forEachContactList(before(kept), [&](ContactKind kind, const auto& contacts) {
        const auto& tracked = before(kept).columnsOf(kind).tracked;
        for (std::size_t i = 0; i < tracked.size(); ++i)
          entries.push_back({tracked[i].key, cornersOf(contacts[i]),
                             tracked[i].age - (m_hasGrown ? 1 : 0), tracked[i].userData});
      });
  itemsOf(file, entries, 1 + sizeof(ContactKey::ids) + sizeof(Triangle) + 12, [&](Entry& entry) {
    description::contactKeyOf(file, entry.key);
    fieldOf(file, entry.corners);
    file.integer(entry.age);
    file.integer(entry.userData);
  });
  fieldOf(file, m_beforeOfSecond);
  for (std::size_t i = 0; i < 2; ++i) {
    revisions[i].elementsOf(file, m_elementsBefore[i]);
    revisions[i].elementsOf(file, m_elements[i]);
  }
  itemsOf(file, m_given, 2 + sizeof(ContactKey::ids) + sizeof(Triangle) + 8,
          [&](ContactMatch::Given& given) {
            description::contactKeyOf(file, given.key);
            fieldOf(file, given.corners);
            fieldOf(file, given.ofSecond);
            file.integer(given.userData);
          });
  for (bool* flag : {&m_keeps, &m_isTracked, &m_isDropped}) fieldOf(file, *flag);
  if constexpr (File::kReads) {
    file.need(std::is_sorted(m_given.begin(), m_given.end(),
                             [](const auto& l, const auto& r) { return l.key < r.key; }),
              "user data of contacts are not in order");
    file.need(std::is_sorted(entries.begin(), entries.end(),
                             [](const Entry& l, const Entry& r) { return l.key < r.key; }),
              "tracked contacts are not in order");
    m_held = {};
    m_isHeld = true;
    m_hasGrown = false;
    forEachContactList(m_held, [&](ContactKind kind, auto& contacts) {
      for (const Entry& entry : entries) {
        if (entry.key.kind != kind) continue;
        m_held.columnsOf(kind).tracked.push_back(
            {entry.key, {}, entry.age, entry.userData, ContactEnd::None});
        auto& contact = contacts.emplace_back();
        if constexpr (requires { contact.vertices; }) contact.vertices = entry.corners;
      }
    });
    // These lists are those of the last answer.
    std::size_t size = 0;
    for (const Contents::Columns& each : kept.columns) size += each.tracked.size();
    file.need(!m_keeps || entries.size() == size, "a number of tracked contacts is wrong");
    file.need(!m_isDropped || !isCurrent || entries.size() == size,
              "tracked contacts are not those of the answer");
  }
}

template <class File>
void SideMemory::describe(File& file, bool self) {
  using namespace description;
  file.integer(m_step);
  file.integer(m_version);
  for (auto* sides : {&m_start, &m_end})
    itemsOf(file, *sides, 1 + sizeof(ContactKey::ids) + sizeof(int) + sizeof(Triangle),
            [&](Side& side) {
              enumeratorOf(file, side.passage.kind, ContactKind::EdgeEdge);
              fieldOf(file, side.passage.ids);
              fieldOf(file, side.passage.forward);
              fieldOf(file, side.corners);
              if constexpr (File::kReads) {
                side.passage.time = 0.0;
                file.need(!self || side.passage.kind != ContactKind::TriangleVertex,
                          "a mesh with itself has no such side");
              }
            });
}

}  // namespace palpate
