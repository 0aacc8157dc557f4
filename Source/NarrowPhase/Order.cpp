#include "NarrowPhase/Order.h"

#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <functional>

namespace palpate {

namespace {

/// Two ids of elements, each below 2^28.
std::uint64_t packed(std::uint32_t first, std::uint32_t second) {
  PALPATE_ASSERT(first >> 28 == 0 && second >> 28 == 0);
  return std::uint64_t{first} << 32 | second;
}

using Ids = std::array<std::uint64_t, 2>;
Ids byVertex(const VertexTriangleContact& c) { return {packed(c.vertex, c.triangle), 0}; }
Ids byTriangle(const VertexTriangleContact& c) { return {packed(c.triangle, c.vertex), 0}; }
Ids byEdges(const EdgeEdgeContact& c) {
  return {packed(c.edgeA[0], c.edgeA[1]), packed(c.edgeB[0], c.edgeB[1])};
}
Ids byElement(const ShapeContact& c) {
  return {packed(static_cast<std::uint32_t>(c.element), c.id), c.vertices[1]};
}

/// Sorts the buffers' contacts of one list, each once, into `out`. Returns the number of contacts
/// from the first `preferred` buffers. flags: if not null, receives which contacts these are.
template <class Contact, class ListOf, class Entries, class IdsOf>
std::size_t order(std::span<ContactBuffers* const> buffers, std::size_t preferred, ListOf&& listOf,
                  Entries& entries, CountedVector<Contact>& out, IdsOf&& idsOf,
                  Buffer<std::uint8_t>* flags) {
  TimeCheck check(256);
  std::size_t size = 0;
  for (const ContactBuffers* found : buffers) size += std::invoke(listOf, *found).size();
  entries.clear();
  if (size > entries.capacity()) entries.reserve(size + size / 8);
  for (std::size_t i = 0; i < buffers.size(); ++i)
    for (const Contact& contact : std::invoke(listOf, *buffers[i])) {
      check();
      const Ids ids = idsOf(contact);
      entries.push_back({ContactSortKey(ids[0], ids[1], i < preferred), &contact});
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
  std::size_t count = 0;
  for (const auto& entry : entries) {
    check();
    out.push_back(*entry.contact);
    count += entry.key.isPreferred();
  }
  if (!flags) return count;
  flags->clear();
  if (preferred > 0)
    for (const auto& entry : entries) {
      check();
      flags->push_back(entry.key.isPreferred());
    }
  return count;
}

}  // namespace

std::size_t orderContacts(std::span<ContactBuffers* const> buffers, std::size_t preferred,
                          OrderScratch& scratch, CollisionData::Contents& out) {
  PALPATE_ASSERT(preferred <= buffers.size());
  const auto shapesOf = [](const ContactBuffers& found) -> auto& { return found.shapes.shape; };
  const std::size_t count =
      order(buffers, preferred, &ContactBuffers::vertexTriangle, scratch.vertexTriangle,
            out.vertexTriangle, byVertex, &scratch.preferred[0]) +
      order(buffers, preferred, &ContactBuffers::triangleVertex, scratch.vertexTriangle,
            out.triangleVertex, byTriangle, &scratch.preferred[1]) +
      order(buffers, preferred, &ContactBuffers::edgeEdge, scratch.edgeEdge, out.edgeEdge, byEdges,
            &scratch.preferred[2]);
  order(buffers, preferred, shapesOf, scratch.shape, out.shape, byElement, nullptr);
  out.shapeShape.clear();
  for (const ContactBuffers* buffer : buffers)
    out.shapeShape.insert(out.shapeShape.end(), buffer->shapes.shapeShape.begin(),
                          buffer->shapes.shapeShape.end());
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
