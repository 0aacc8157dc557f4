#include "CollisionDetection/Order.h"

#include <algorithm>

namespace palpate {

namespace {

std::uint64_t packed(std::uint32_t first, std::uint32_t second) {
  return std::uint64_t{first} << 32 | second;
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

void orderContacts(std::span<ContactBuffers* const> buffers, OrderScratch& scratch,
                   CollisionData::Contents& out) {
  order(buffers, &ContactBuffers::vertexTriangle, scratch.vertexTriangle, out.vertexTriangle,
        [](const VertexTriangleContact& c) {
          return std::array{packed(c.vertex, c.triangle), std::uint64_t{0}};
        });
  order(buffers, &ContactBuffers::triangleVertex, scratch.vertexTriangle, out.triangleVertex,
        [](const VertexTriangleContact& c) {
          return std::array{packed(c.triangle, c.vertex), std::uint64_t{0}};
        });
  order(buffers, &ContactBuffers::edgeEdge, scratch.edgeEdge, out.edgeEdge,
        [](const EdgeEdgeContact& c) {
          return std::array{packed(c.edgeA[0], c.edgeA[1]), packed(c.edgeB[0], c.edgeB[1])};
        });
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

}  // namespace palpate
