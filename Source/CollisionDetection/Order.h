#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/NarrowPhase.h"

#include <span>

namespace palpate {

/// Scratch of the ordering, which remembers its peak.
struct OrderScratch {
  template <class Contact>
  struct Entry {
    std::array<std::uint64_t, 2> key;
    const Contact* contact;
  };
  Buffer<Entry<VertexTriangleContact>> vertexTriangle;
  Buffer<Entry<EdgeEdgeContact>> edgeEdge;
};

/// The buffers' contacts, sorted by element ids, each once.
void orderContacts(std::span<ContactBuffers* const>, OrderScratch&, CollisionData::Contents&);

}  // namespace palpate
