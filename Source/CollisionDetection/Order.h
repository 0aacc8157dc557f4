#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/NarrowPhase.h"

#include <array>
#include <cstdint>
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
  Buffer<Entry<ShapeContact>> shape;
  /// Of vertexTriangle, triangleVertex and edgeEdge as ordered last: which contacts are of the
  /// preferred buffers. Empty where there are no such buffers.
  std::array<Buffer<std::uint8_t>, 3> preferred;
};

struct PairOrderScratch {
  Buffer<std::uint32_t> places;
  Buffer<TrianglePair> pairs;
};

/// Sorts by (a, b), where every a is below `firsts`.
/// Cost     two passes over the pairs and one over `firsts` counters.
void orderPairs(Buffer<TrianglePair>& pairs, std::size_t firsts, PairOrderScratch&);

/// The buffers' contacts, sorted by element ids, each once: where the first `preferred` buffers
/// have one of the same features as the others, theirs. Returns how many are theirs.
std::size_t orderContacts(std::span<ContactBuffers* const>, std::size_t preferred, OrderScratch&,
                          CollisionData::Contents&);

}  // namespace palpate
