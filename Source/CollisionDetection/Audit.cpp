#include "CollisionDetection/Audit.h"

#include "CollisionDetection/Order.h"

#include <algorithm>
#include <array>
#include <initializer_list>
#include <random>
#include <span>

namespace palpate {

namespace {

std::uint32_t low(std::uint64_t value) { return static_cast<std::uint32_t>(value); }
std::uint32_t high(std::uint64_t value) { return static_cast<std::uint32_t>(value >> 32); }

/// `count` of the numbers below `size`, ascending. (Bentley and Floyd, A sample of brilliance,
/// Communications of the ACM 30, 1987.)
std::vector<std::uint64_t> drawNumbers(std::uint64_t count, std::uint64_t size,
                                       std::mt19937_64& random) {
  std::vector<std::uint64_t> drawn;
  for (std::uint64_t last = size - count; last < size; ++last) {
    std::uint64_t number = random() % (last + 1);
    auto place = std::lower_bound(drawn.begin(), drawn.end(), number);
    if (place != drawn.end() && *place == number) {
      number = last;
      place = drawn.end();
    }
    drawn.insert(place, number);
  }
  return drawn;
}

/// The ids by which contacts are ordered and told apart.
std::array<std::uint32_t, 2> idsOf(const VertexTriangleContact& c) {
  return {c.vertex, c.triangle};
}
std::array<std::uint32_t, 4> idsOf(const EdgeEdgeContact& c) {
  return {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]};
}
std::array<std::uint32_t, 2> idsOf(const TrianglePair& pair) { return {pair.a, pair.b}; }

/// Calls f with those expected that are not among those found.
template <class Contact, class F>
void forEachMissing(std::span<const Contact> expected, std::span<const Contact> found, F&& f) {
  const auto before = [](const Contact* l, const Contact* r) { return idsOf(*l) < idsOf(*r); };
  std::vector<const Contact*> sorted;
  for (const Contact& contact : found) sorted.push_back(&contact);
  std::sort(sorted.begin(), sorted.end(), before);
  for (const Contact& contact : expected)
    if (!std::binary_search(sorted.begin(), sorted.end(), &contact, before)) f(contact);
}

}  // namespace

FeatureLists drawFeatures(const MeshPair& meshes, const CollisionPair& pair,
                          const AuditSettings& settings, std::uint64_t frame) {
  FeatureLists features = everyFeature(meshes);
  const std::initializer_list<std::vector<std::uint32_t>*> lists{
      &features.verticesOfA, &features.verticesOfB, &features.edgesOfA, &features.trianglesOfA};
  std::uint64_t size = 0;
  for (const auto* list : lists) size += list->size();
  const auto count = static_cast<std::uint64_t>(settings.features);
  if (count >= size) return features;

  const auto a = static_cast<std::uint32_t>(pair.a), b = static_cast<std::uint32_t>(pair.b);
  std::seed_seq seed{low(settings.seed), high(settings.seed), low(frame), high(frame), a, b};
  std::mt19937_64 random(seed);
  const std::vector<std::uint64_t> drawn = drawNumbers(count, size, random);
  auto next = drawn.begin();
  std::uint64_t first = 0;
  for (auto* list : lists) {
    const std::uint64_t listSize = list->size();
    std::size_t kept = 0;
    for (; next != drawn.end() && *next < first + listSize; ++next)
      (*list)[kept++] = (*list)[*next - first];
    list->resize(kept);
    first += listSize;
  }
  return features;
}

void audit(const MeshPair& meshes, const CollisionPair& pair, const CollisionData& data,
           const AuditSettings& settings, std::uint64_t frame, std::vector<AuditFailure>& out) {
  ContactBuffers contacts;
  findContactsByBruteForce(meshes, drawFeatures(meshes, pair, settings, frame), contacts);
  ContactBuffers* const buffers[] = {&contacts};
  OrderScratch scratch;
  CollisionData::Contents expected;
  orderContacts(buffers, scratch, expected);

  using List = AuditFailure::List;
  const auto report = [&](List list) {
    return [=, &pair, &out](const auto& contact) {
      out.push_back({pair.a, pair.b, frame, list, contact});
    };
  };
  if (meshes.settings.contacts == Contacts::Earliest) {
    const auto reportEarlier = [&](const auto& all) {
      for (const auto& contact : all)
        if (contact.timeOfImpact < data.earliestTimeOfImpact()) report(List::Earliest)(contact);
    };
    reportEarlier(expected.vertexTriangle);
    reportEarlier(expected.triangleVertex);
    reportEarlier(expected.edgeEdge);
    return;
  }
  forEachMissing<VertexTriangleContact>(expected.vertexTriangle, data.vertexTriangle(),
                                        report(List::VertexTriangle));
  forEachMissing<VertexTriangleContact>(expected.triangleVertex, data.triangleVertex(),
                                        report(List::TriangleVertex));
  forEachMissing<EdgeEdgeContact>(expected.edgeEdge, data.edgeEdge(), report(List::EdgeEdge));
  forEachMissing<TrianglePair>(expected.intersectingTriangles, data.intersectingTriangles(),
                               report(List::IntersectingTriangles));
}

}  // namespace palpate
