#include "Mesh/TriangleMesh.h"

#include "Core/Assert.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace palpate {

MeshTopology::MeshTopology(std::size_t newVertexCount, std::span<const Triangle> newElements,
                           std::span<const std::uint32_t> newRemoved)
    : vertexCount(newVertexCount),
      elements(newElements.begin(), newElements.end()),
      triangleEdges(newElements.size()),
      isUsed(newVertexCount, false),
      removed(newRemoved.begin(), newRemoved.end()) {
  PALPATE_ASSERT(std::all_of(newElements.begin(), newElements.end(), [&](const Triangle& t) {
    return std::max({t[0], t[1], t[2]}) < newVertexCount;
  }));
  for (const std::uint32_t t : removed) {
    elements[t] = {0, 0, 0};
    triangleEdges[t] = {kNoEdge, kNoEdge, kNoEdge};
  }
  struct Side {
    Segment edge;
    std::uint32_t triangle, side;
  };
  CountedVector<Side> sides;
  sides.reserve(3 * count());
  forEachElement([&](std::uint32_t t) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      isUsed[elements[t][i]] = true;
      const std::uint32_t p = elements[t][i], q = elements[t][(i + 1) % 3];
      triangleEdges[t][i] = kNoEdge;
      if (p != q) sides.push_back({{std::min(p, q), std::max(p, q)}, t, i});
    }
  });
  std::sort(sides.begin(), sides.end(), [](const Side& l, const Side& r) {
    return std::tie(l.edge, l.triangle, l.side) < std::tie(r.edge, r.triangle, r.side);
  });
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const auto& [edge, triangle, side] = sides[i];
    if (i == 0 || edge != sides[i - 1].edge) edges.push_back(edge);
    triangleEdges[triangle][side] = static_cast<std::uint32_t>(edges.size() - 1);
  }
  PALPATE_ASSERT(std::is_sorted(edges.begin(), edges.end()));
  disable({});
}

void MeshTopology::disable(std::span<const std::uint32_t> newDisabled) {
  const std::size_t size = newDisabled.empty() && removed.empty() ? 0 : elements.size();
  CountedVector<bool> newIsDisabled(size, false);
  for (const std::uint32_t triangle : newDisabled) {
    PALPATE_ASSERT(triangle < elements.size());
    newIsDisabled[triangle] = true;
  }
  for (const std::uint32_t triangle : removed) newIsDisabled[triangle] = false;
  CountedVector<std::uint32_t> sorted;
  for (std::uint32_t t = 0; t < newIsDisabled.size(); ++t)
    if (newIsDisabled[t]) sorted.push_back(t);
  for (const std::uint32_t triangle : removed) newIsDisabled[triangle] = true;
  findOwners(newIsDisabled);
  // Nothing below throws.
  disabled = std::move(sorted);
  isDisabled = std::move(newIsDisabled);
}

/// Changes nothing if it throws.
void MeshTopology::findOwners(const CountedVector<bool>& newIsDisabled) {
  // A vertex or edge that a triangle contains twice counts once.
  const auto listsOf = [&](std::size_t count, const auto& heldBy) {
    return listsByKey(count, [&](auto&& incidence) {
      for (std::uint32_t t = 0; t < elements.size(); ++t) {
        if (!newIsDisabled.empty() && newIsDisabled[t]) continue;
        const auto& [a, b, c] = heldBy[t];
        if (a != kNoEdge) incidence(a, t);
        if (b != kNoEdge && b != a) incidence(b, t);
        if (c != kNoEdge && c != a && c != b) incidence(c, t);
      }
    });
  };
  IndexLists atVertices = listsOf(vertexCount, elements);
  IndexLists atEdges = listsOf(edges.size(), triangleEdges);

  CountedVector<std::uint8_t> owners(elements.size(), 0);
  const auto assignOwner = [&](std::uint32_t item, std::uint32_t owner, const auto& held,
                               auto&& bitOf) {
    const auto place = std::find(held.begin(), held.end(), item) - held.begin();
    PALPATE_ASSERT(place < 3);
    owners[owner] |= static_cast<std::uint8_t>(bitOf(static_cast<int>(place)));
  };
  std::size_t untested = 0;
  for (std::uint32_t v = 0; v < vertexCount; ++v) {
    const auto incident = atVertices[v];
    if (incident.empty())
      ++untested;
    else
      assignOwner(v, incident.front(), elements[incident.front()], cornerBit);
  }
  CountedVector<std::uint8_t> closedStars(vertexCount, 1);
  const auto isForward = [&](std::uint32_t e, std::uint32_t triangle) {
    const auto side = std::find(triangleEdges[triangle].begin(), triangleEdges[triangle].end(), e);
    PALPATE_ASSERT(side != triangleEdges[triangle].end());
    return elements[triangle][side - triangleEdges[triangle].begin()] == edges[e][0];
  };
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    const auto incident = atEdges[e];
    if (!incident.empty())
      assignOwner(e, incident.front(), triangleEdges[incident.front()], edgeBit);
    if (incident.size() != 2 || isForward(e, incident[0]) == isForward(e, incident[1]))
      closedStars[edges[e][0]] = closedStars[edges[e][1]] = 0;
  }
  // Nothing below throws.
  vertexTriangles = std::move(atVertices);
  edgeTriangles = std::move(atEdges);
  owned = std::move(owners);
  untestedVertices = untested;
  hasOnlyClosedStars = std::find(closedStars.begin(), closedStars.end(), 0) == closedStars.end();
  hasClosedStar = std::move(closedStars);
}

std::uint32_t MeshTopology::lowest() const {
  PALPATE_ASSERT(count() > 0);
  std::uint32_t lowest = 0;
  while (lowest < removed.size() && removed[lowest] == lowest) ++lowest;
  return lowest;
}

std::uint32_t MeshTopology::edgeOf(const Segment& edge) const {
  const auto place = std::lower_bound(edges.begin(), edges.end(), edge);
  if (place == edges.end() || *place != edge) return kNoEdge;
  return static_cast<std::uint32_t>(place - edges.begin());
}

}  // namespace palpate
