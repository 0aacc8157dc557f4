#include "Mesh/TriangleMesh.h"

#include "Core/Assert.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace palpate {

IndexLists::IndexLists(std::span<const std::uint32_t> offsets, CountedVector<std::uint32_t> items)
    : m_items(std::move(items)) {
  PALPATE_ASSERT(!offsets.empty() && offsets.back() == m_items.size());
  m_ranges.reserve(withSpare(offsets.size() - 1));
  for (std::size_t i = 0; i + 1 < offsets.size(); ++i)
    m_ranges.push_back({offsets[i], offsets[i + 1] - offsets[i]});
}

std::size_t IndexLists::bytes() const {
  return m_ranges.capacity() * sizeof(Range) + m_items.capacity() * sizeof(std::uint32_t);
}

void IndexLists::reserveMore(std::size_t lists, std::size_t items) {
  reserveAmortized(m_ranges, m_ranges.size() + lists);
  if (m_items.size() + items <= m_items.capacity()) return;
  CountedVector<std::uint32_t> kept;
  kept.reserve(withSpare(itemCount() + items) + itemCount() / 2);
  for (const Range& range : m_ranges)
    kept.insert(kept.end(), m_items.begin() + range.begin,
                m_items.begin() + range.begin + range.size);
  // Nothing below throws.
  std::uint32_t begin = 0;
  for (Range& range : m_ranges) {
    range.begin = begin;
    begin += range.size;
  }
  m_items = std::move(kept);
  m_lost = 0;
}

void IndexLists::append(std::span<const std::uint32_t> list) {
  m_ranges.push_back(
      {static_cast<std::uint32_t>(m_items.size()), static_cast<std::uint32_t>(list.size())});
  m_items.insert(m_items.end(), list.begin(), list.end());
}

void IndexLists::replace(std::size_t i, std::span<const std::uint32_t> list) {
  PALPATE_ASSERT(i < m_ranges.size());
  Range& range = m_ranges[i];
  if (list.size() > range.size) {
    m_lost += range.size;
    range.begin = static_cast<std::uint32_t>(m_items.size());
    m_items.insert(m_items.end(), list.begin(), list.end());
  } else {
    m_lost += range.size - list.size();
    std::copy(list.begin(), list.end(), m_items.begin() + range.begin);
  }
  range.size = static_cast<std::uint32_t>(list.size());
}

MeshTopology::MeshTopology(std::size_t newVertexCount, std::span<const Triangle> newElements,
                           std::span<const std::uint32_t> newRemoved)
    : vertexCount(newVertexCount), removed(newRemoved.begin(), newRemoved.end()) {
  const std::size_t size = newElements.size();
  elements.reserve(withSpare(size));
  elements.assign(newElements.begin(), newElements.end());
  triangleEdges.reserve(withSpare(size));
  triangleEdges.resize(size);
  isUsed.reserve(withSpare(vertexCount));
  isUsed.resize(vertexCount, false);
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
  std::size_t edgeCount = 0;
  for (std::size_t i = 0; i < sides.size(); ++i)
    edgeCount += i == 0 || sides[i].edge != sides[i - 1].edge;
  edges.reserve(withSpare(edgeCount));
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

  CountedVector<std::uint8_t> owners;
  owners.reserve(withSpare(elements.size()));
  owners.resize(elements.size(), 0);
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
  CountedVector<std::uint8_t> closedStars;
  closedStars.reserve(withSpare(vertexCount));
  closedStars.resize(vertexCount, 1);
  const auto isForward = [&](std::uint32_t e, std::uint32_t triangle) {
    const auto side = std::find(triangleEdges[triangle].begin(), triangleEdges[triangle].end(), e);
    PALPATE_ASSERT(side != triangleEdges[triangle].end());
    return elements[triangle][side - triangleEdges[triangle].begin()] == edges[e][0];
  };
  forEachEdge([&](std::uint32_t e) {
    const auto incident = atEdges[e];
    if (!incident.empty())
      assignOwner(e, incident.front(), triangleEdges[incident.front()], edgeBit);
    if (incident.size() != 2 || isForward(e, incident[0]) == isForward(e, incident[1]))
      closedStars[edges[e][0]] = closedStars[edges[e][1]] = 0;
  });
  // Nothing below throws.
  vertexTriangles = std::move(atVertices);
  edgeTriangles = std::move(atEdges);
  owned = std::move(owners);
  untestedVertices = untested;
  openStars = static_cast<std::size_t>(std::count(closedStars.begin(), closedStars.end(), 0));
  hasClosedStar = std::move(closedStars);
}

std::uint32_t MeshTopology::lowest() const {
  PALPATE_ASSERT(count() > 0);
  std::uint32_t lowest = 0;
  while (lowest < removed.size() && removed[lowest] == lowest) ++lowest;
  return lowest;
}

std::uint32_t MeshTopology::findEdge(const Segment& edge) const {
  const auto sorted = edges.begin() + static_cast<std::ptrdiff_t>(sortedEdges());
  const auto place = std::lower_bound(edges.begin(), sorted, edge);
  if (place != sorted && *place == edge) return static_cast<std::uint32_t>(place - edges.begin());
  const auto added = std::lower_bound(
      m_addedEdges.begin(), m_addedEdges.end(), edge,
      [&](std::uint32_t e, const Segment& vertices) { return edges[e] < vertices; });
  return added != m_addedEdges.end() && edges[*added] == edge ? *added : kNoEdge;
}

std::uint32_t MeshTopology::edgeOf(const Segment& edge) const {
  const std::uint32_t found = findEdge(edge);
  return hasEdge(found) ? found : kNoEdge;
}

}  // namespace palpate
