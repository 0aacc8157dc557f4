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
  itemsOf(file, m_before, 1 + sizeof(ContactKey::ids) + sizeof(Triangle) + 12, [&](Entry& entry) {
    description::contactKeyOf(file, entry.key);
    fieldOf(file, entry.corners);
    file.integer(entry.age);
    file.integer(entry.userData);
    if constexpr (File::kReads) entry.isPredecessor = false;
  });
  fieldOf(file, m_beforeOfSecond);
  for (std::size_t i = 0; i < 2; ++i) {
    revisions[i].elementsOf(file, m_elementsBefore[i]);
    revisions[i].elementsOf(file, m_elements[i]);
  }
  for (bool* flag : {&m_keeps, &m_repeats, &m_isDropped}) fieldOf(file, *flag);
  if constexpr (File::kReads) {
    file.need(std::is_sorted(m_before.begin(), m_before.end(),
                             [](const Entry& l, const Entry& r) { return l.key < r.key; }),
              "tracked contacts are not in order");
    // commit() writes to all contacts of the last answer.
    const auto& t = kept.tracked;
    const std::size_t size = t.vertexTriangle.size() + t.triangleVertex.size() + t.edgeEdge.size() +
                             t.shape.size() + t.shapeShape.size();
    file.need(!m_keeps || m_before.size() == size, "a number of tracked contacts is wrong");
    file.need(!m_isDropped || !isCurrent || m_before.size() == size,
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
