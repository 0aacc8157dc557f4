#include "CollisionDetection/Order.h"

#include <algorithm>
#include <numeric>

namespace palpate {

namespace {

std::uint64_t packed(std::uint32_t first, std::uint32_t second) {
  return std::uint64_t{first} << 32 | second;
}

using Key = std::array<std::uint64_t, 2>;
Key byVertex(const VertexTriangleContact& c) { return {packed(c.vertex, c.triangle), 0}; }
Key byTriangle(const VertexTriangleContact& c) { return {packed(c.triangle, c.vertex), 0}; }
Key byEdges(const EdgeEdgeContact& c) {
  return {packed(c.edgeA[0], c.edgeA[1]), packed(c.edgeB[0], c.edgeB[1])};
}
Key byElement(const ShapeContact& c) {
  return {packed(static_cast<std::uint32_t>(c.element), c.id), c.vertices[1]};
}

template <class Contact, class Entries, class KeyOf>
void order(std::span<ContactBuffers* const> buffers, Buffer<Contact> ContactBuffers::*member,
           Entries& entries, std::vector<Contact>& out, KeyOf&& keyOf) {
  entries.clear();
  for (const ContactBuffers* buffer : buffers)
    for (const Contact& contact : buffer->*member) entries.push_back({keyOf(contact), &contact});
  std::sort(entries.begin(), entries.end(),
            [](const auto& l, const auto& r) { return l.key < r.key; });
  entries.erase(std::unique(entries.begin(), entries.end(),
                            [](const auto& l, const auto& r) { return l.key == r.key; }),
                entries.end());
  out.clear();
  out.reserve(entries.size());
  for (const auto& entry : entries) out.push_back(*entry.contact);
}

}  // namespace

void orderPairs(Buffer<TrianglePair>& pairs, std::size_t firsts, PairOrderScratch& scratch) {
  if (pairs.size() < firsts / 8) {  // the counters would cost more than they save
    std::sort(pairs.begin(), pairs.end());
    return;
  }
  Buffer<std::uint32_t>& next = scratch.places;  // where a's pairs go; in the end, where they end
  next.assign(firsts, 0);
  for (const TrianglePair& pair : pairs) ++next[pair.a];
  std::exclusive_scan(next.begin(), next.end(), next.begin(), 0u);
  scratch.pairs.resize(pairs.size());
  for (const TrianglePair& pair : pairs) scratch.pairs[next[pair.a]++] = pair;
  auto begin = scratch.pairs.begin();
  for (const std::uint32_t place : next) {
    const auto end = scratch.pairs.begin() + place;
    std::sort(begin, end, [](const TrianglePair& l, const TrianglePair& r) { return l.b < r.b; });
    begin = end;
  }
  std::copy(scratch.pairs.begin(), scratch.pairs.end(), pairs.begin());
}

void orderContacts(std::span<ContactBuffers* const> buffers, OrderScratch& scratch,
                   CollisionData::Contents& out) {
  order(buffers, &ContactBuffers::vertexTriangle, scratch.vertexTriangle, out.vertexTriangle,
        byVertex);
  order(buffers, &ContactBuffers::triangleVertex, scratch.vertexTriangle, out.triangleVertex,
        byTriangle);
  order(buffers, &ContactBuffers::edgeEdge, scratch.edgeEdge, out.edgeEdge, byEdges);
  order(buffers, &ContactBuffers::shape, scratch.shape, out.shape, byElement);
  out.intersectingTriangles.clear();
  for (const ContactBuffers* buffer : buffers)
    out.intersectingTriangles.insert(out.intersectingTriangles.end(),
                                     buffer->intersectingTriangles.begin(),
                                     buffer->intersectingTriangles.end());
  std::sort(out.intersectingTriangles.begin(), out.intersectingTriangles.end());
  out.intersectingTriangles.erase(
      std::unique(out.intersectingTriangles.begin(), out.intersectingTriangles.end()),
      out.intersectingTriangles.end());
}

void dropAnswered(ContactBuffers& found, const CollisionData::Contents& answered) {
  const auto drop = [](auto& contacts, const auto& sorted, auto&& keyOf) {
    std::erase_if(contacts, [&](const auto& contact) {
      return std::binary_search(sorted.begin(), sorted.end(), contact,
                                [&](const auto& l, const auto& r) { return keyOf(l) < keyOf(r); });
    });
  };
  drop(found.vertexTriangle, answered.vertexTriangle, byVertex);
  drop(found.triangleVertex, answered.triangleVertex, byTriangle);
  drop(found.edgeEdge, answered.edgeEdge, byEdges);
}

}  // namespace palpate
