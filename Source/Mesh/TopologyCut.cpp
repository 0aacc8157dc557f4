#include "Mesh/TopologyCut.h"

#include "Core/Assert.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

namespace palpate {

namespace {

using Ids = CountedVector<std::uint32_t>;

template <class T>
void sortUnique(CountedVector<T>& list) {
  std::sort(list.begin(), list.end());
  list.erase(std::unique(list.begin(), list.end()), list.end());
}

Segment edgeOf(std::uint32_t p, std::uint32_t q) { return {std::min(p, q), std::max(p, q)}; }

template <class F>
void forEachEdge(const Triangle& t, F&& f) {
  for (std::size_t i = 0; i < 3; ++i)
    if (t[i] != t[(i + 1) % 3]) f(edgeOf(t[i], t[(i + 1) % 3]));
}

/// Elements by a vertex or an edge that they hold.
template <class Key>
class Holders {
 public:
  void add(const Key& key, std::uint32_t element) { m_all.push_back({key, element}); }
  void sort() { sortUnique(m_all); }
  /// Those of a key, ascending.
  std::span<const std::pair<Key, std::uint32_t>> of(const Key& key) const {
    const auto begin = std::lower_bound(m_all.begin(), m_all.end(), std::pair(key, 0u));
    auto end = begin;
    while (end != m_all.end() && end->first == key) ++end;
    return {begin, end};
  }

 private:
  CountedVector<std::pair<Key, std::uint32_t>> m_all;
};

/// Some elements, by their vertices and edges.
struct Elements {
  Holders<std::uint32_t> byVertex;
  Holders<Segment> byEdge;
  void add(const Triangle& t, std::uint32_t element) {
    for (const std::uint32_t v : t) byVertex.add(v, element);
    forEachEdge(t, [&](const Segment& edge) { byEdge.add(edge, element); });
  }
  void sort() { byVertex.sort(), byEdge.sort(); }
};

/// Lists of which some are replaced.
class ListCopy {
 public:
  ListCopy(const IndexLists& from, std::size_t lists, std::size_t items) : m_from(from) {
    m_to.offsets.clear();
    m_to.offsets.reserve(lists + 1);
    m_to.offsets.push_back(0);
    m_to.items.reserve(items);
  }
  /// Copies lists [begin, end).
  void copy(std::size_t begin, std::size_t end) {
    if (begin >= end) return;
    const std::uint32_t first = m_from.offsets[begin],
                        shift = static_cast<std::uint32_t>(m_to.items.size()) - first;
    m_to.items.insert(m_to.items.end(), m_from.items.begin() + first,
                      m_from.items.begin() + m_from.offsets[end]);
    for (std::size_t i = begin; i < end; ++i) m_to.offsets.push_back(m_from.offsets[i + 1] + shift);
  }
  void append(std::span<const std::uint32_t> list) {
    m_to.items.insert(m_to.items.end(), list.begin(), list.end());
    m_to.offsets.push_back(static_cast<std::uint32_t>(m_to.items.size()));
  }
  IndexLists take() { return std::move(m_to); }

 private:
  const IndexLists& m_from;
  IndexLists m_to;
};

class TopologyCut {
 public:
  TopologyCut(const MeshTopology& before, std::span<const std::uint32_t> removed,
              std::span<const Triangle> added, std::size_t vertexCount)
      : m_before(before), m_removed(removed), m_added(added) {
    m_next.type = before.type;
    m_next.vertexCount = vertexCount;
  }

  MeshTopology run() {
    replaceElements();
    findAffected();
    replaceEdges();
    replaceLists();
    replaceOwners();
    findClosedStars();
    return std::move(m_next);
  }

 private:
  std::uint32_t firstAdded() const { return static_cast<std::uint32_t>(m_before.elements.size()); }
  bool isRemoved(std::uint32_t t) const {
    return std::binary_search(m_removed.begin(), m_removed.end(), t);
  }

  void replaceElements() {
    const std::size_t size = m_before.elements.size() + m_added.size();
    m_next.elements.reserve(size);
    m_next.elements = m_before.elements;
    m_next.elements.insert(m_next.elements.end(), m_added.begin(), m_added.end());
    for (const std::uint32_t t : m_removed) m_next.elements[t] = {0, 0, 0};
    std::merge(m_before.removed.begin(), m_before.removed.end(), m_removed.begin(), m_removed.end(),
               std::back_inserter(m_next.removed));
    std::set_difference(m_before.disabled.begin(), m_before.disabled.end(), m_removed.begin(),
                        m_removed.end(), std::back_inserter(m_next.disabled));
    if (m_next.removed.empty() && m_next.disabled.empty()) return;
    m_next.isDisabled = m_before.isDisabled;
    m_next.isDisabled.resize(size, false);
    for (const std::uint32_t t : m_removed) m_next.isDisabled[t] = true;
  }

  /// The vertices and edges of triangles that are removed or added.
  void findAffected() {
    const auto add = [&](const Triangle& t) {
      m_vertices.insert(m_vertices.end(), t.begin(), t.end());
      forEachEdge(t, [&](const Segment& edge) { m_edges.push_back(edge); });
    };
    for (const std::uint32_t t : m_removed) add(m_before.elements[t]);
    for (const Triangle& t : m_added) add(t);
    for (std::size_t v = m_before.vertexCount; v < m_next.vertexCount; ++v)
      m_vertices.push_back(static_cast<std::uint32_t>(v));
    sortUnique(m_vertices);
    sortUnique(m_edges);
    for (const Segment& edge : m_edges) m_edgesBefore.push_back(m_before.edgeOf(edge));
    for (std::size_t i = 0; i < m_added.size(); ++i)
      m_addedBy.add(m_added[i], firstAdded() + static_cast<std::uint32_t>(i));
    for (const std::uint32_t t : m_next.disabled) m_disabledBy.add(m_next.elements[t], t);
    m_addedBy.sort(), m_disabledBy.sort();
  }

  /// The enabled triangles of a list that is affected, after the cut.
  template <class Added>
  Ids listAfter(std::span<const std::uint32_t> before, const Added& added) const {
    Ids list;
    for (const std::uint32_t t : before)
      if (!isRemoved(t)) list.push_back(t);
    for (const auto& [key, t] : added) list.push_back(t);
    return list;
  }

  void replaceEdges() {
    for (std::size_t i = 0; i < m_edges.size(); ++i) {
      const std::uint32_t before = m_edgesBefore[i];
      m_edgeLists.push_back(listAfter(
          before == kNoEdge ? std::span<const std::uint32_t>() : m_before.edgeTriangles[before],
          m_addedBy.byEdge.of(m_edges[i])));
      m_stays.push_back(!m_edgeLists.back().empty() || !m_disabledBy.byEdge.of(m_edges[i]).empty());
    }
    // Edges between those that are affected keep their order.
    Ids numbers(m_before.edges.size());  // the new number of each edge
    m_next.edges.reserve(m_before.edges.size() + m_edges.size());
    std::size_t from = 0;
    const auto copyTo = [&](std::size_t end) {
      const auto shift = static_cast<std::uint32_t>(m_next.edges.size() - from);
      m_next.edges.insert(m_next.edges.end(),
                          m_before.edges.begin() + static_cast<std::ptrdiff_t>(from),
                          m_before.edges.begin() + static_cast<std::ptrdiff_t>(end));
      for (; from < end; ++from) numbers[from] = static_cast<std::uint32_t>(from) + shift;
    };
    for (std::size_t i = 0; i < m_edges.size(); ++i) {
      copyTo(static_cast<std::size_t>(
          std::lower_bound(m_before.edges.begin() + static_cast<std::ptrdiff_t>(from),
                           m_before.edges.end(), m_edges[i]) -
          m_before.edges.begin()));
      const auto number = static_cast<std::uint32_t>(m_next.edges.size());
      if (m_stays[i]) m_next.edges.push_back(m_edges[i]);
      if (m_edgesBefore[i] != kNoEdge) numbers[from++] = m_stays[i] ? number : kNoEdge;
    }
    copyTo(m_before.edges.size());
    PALPATE_ASSERT(std::is_sorted(m_next.edges.begin(), m_next.edges.end()));

    m_next.triangleEdges.reserve(m_next.elements.size());
    for (const auto& edges : m_before.triangleEdges) {
      auto& next = m_next.triangleEdges.emplace_back(edges);
      for (std::uint32_t& edge : next)
        if (edge != kNoEdge) edge = numbers[edge];
    }
    for (const std::uint32_t t : m_removed) m_next.triangleEdges[t] = {kNoEdge, kNoEdge, kNoEdge};
    for (const Triangle& t : m_added) {
      auto& edges = m_next.triangleEdges.emplace_back();
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t p = t[i], q = t[(i + 1) % 3];
        edges[i] = p == q ? kNoEdge : m_next.edgeOf(palpate::edgeOf(p, q));
      }
    }
  }

  void replaceLists() {
    const std::size_t items = 3 * m_added.size();
    ListCopy vertices(m_before.vertexTriangles, m_next.vertexCount,
                      m_before.vertexTriangles.items.size() + items);
    std::size_t from = 0;
    for (const std::uint32_t v : m_vertices) {
      vertices.copy(from, std::min<std::size_t>(v, m_before.vertexCount));
      m_vertexLists.push_back(listAfter(
          v < m_before.vertexCount ? m_before.vertexTriangles[v] : std::span<const std::uint32_t>(),
          m_addedBy.byVertex.of(v)));
      vertices.append(m_vertexLists.back());
      from = v + std::size_t{1};
    }
    vertices.copy(from, m_before.vertexCount);
    m_next.vertexTriangles = vertices.take();

    ListCopy edges(m_before.edgeTriangles, m_next.edges.size(),
                   m_before.edgeTriangles.items.size() + items);
    from = 0;
    for (std::size_t i = 0; i < m_edges.size(); ++i) {
      const auto place = static_cast<std::size_t>(
          std::lower_bound(m_before.edges.begin() + static_cast<std::ptrdiff_t>(from),
                           m_before.edges.end(), m_edges[i]) -
          m_before.edges.begin());
      edges.copy(from, place);
      if (m_stays[i]) edges.append(m_edgeLists[i]);
      from = place + (m_edgesBefore[i] != kNoEdge);
    }
    edges.copy(from, m_before.edges.size());
    m_next.edgeTriangles = edges.take();
  }

  void replaceOwners() {
    m_next.owned.reserve(m_next.elements.size());
    m_next.owned = m_before.owned;
    m_next.owned.resize(m_next.elements.size(), 0);
    const auto flip = [&](std::uint32_t owner, const auto& held, std::uint32_t item, auto&& bitOf) {
      const auto place = std::find(held.begin(), held.end(), item) - held.begin();
      PALPATE_ASSERT(place < 3);
      m_next.owned[owner] ^= static_cast<std::uint8_t>(bitOf(static_cast<int>(place)));
    };
    m_next.isUsed = m_before.isUsed;
    m_next.isUsed.resize(m_next.vertexCount, false);
    m_next.untestedVertices = m_before.untestedVertices;
    for (std::size_t i = 0; i < m_vertices.size(); ++i) {
      const std::uint32_t v = m_vertices[i];
      const Ids& list = m_vertexLists[i];
      const bool isNew = v >= m_before.vertexCount;
      const auto before = isNew ? std::span<const std::uint32_t>() : m_before.vertexTriangles[v];
      m_next.untestedVertices += list.empty();
      m_next.untestedVertices -= !isNew && before.empty();
      m_next.isUsed[v] = !list.empty() || !m_disabledBy.byVertex.of(v).empty();
      if (!before.empty())
        flip(before.front(), m_before.elements[before.front()], v, MeshTopology::cornerBit);
      if (!list.empty())
        flip(list.front(), m_next.elements[list.front()], v, MeshTopology::cornerBit);
    }
    for (std::size_t i = 0; i < m_edges.size(); ++i) {
      if (const std::uint32_t e = m_edgesBefore[i]; e != kNoEdge)
        if (const auto before = m_before.edgeTriangles[e]; !before.empty())
          flip(before.front(), m_before.triangleEdges[before.front()], e, MeshTopology::edgeBit);
      if (m_edgeLists[i].empty()) continue;
      const std::uint32_t owner = m_edgeLists[i].front();
      flip(owner, m_next.triangleEdges[owner], m_next.edgeOf(m_edges[i]), MeshTopology::edgeBit);
    }
  }

  bool isClosed(std::uint32_t edge) const {
    const auto held = m_next.edgeTriangles[edge];
    if (held.size() != 2) return false;
    const auto isForward = [&](std::uint32_t t) {
      const auto& sides = m_next.triangleEdges[t];
      const auto side = std::find(sides.begin(), sides.end(), edge) - sides.begin();
      return m_next.elements[t][static_cast<std::size_t>(side)] == m_next.edges[edge][0];
    };
    return isForward(held[0]) != isForward(held[1]);
  }

  void findClosedStars() {
    m_next.hasClosedStar.reserve(m_next.vertexCount);
    m_next.hasClosedStar = m_before.hasClosedStar;
    m_next.hasClosedStar.resize(m_next.vertexCount, 1);
    // Every end of an affected edge is an affected vertex.
    for (std::size_t i = 0; i < m_vertices.size(); ++i) {
      const std::uint32_t v = m_vertices[i];
      const auto areClosed = [&](std::uint32_t t) {
        return std::all_of(
            m_next.triangleEdges[t].begin(), m_next.triangleEdges[t].end(), [&](std::uint32_t e) {
              return e == kNoEdge || (m_next.edges[e][0] != v && m_next.edges[e][1] != v) ||
                     isClosed(e);
            });
      };
      const auto disabled = m_disabledBy.byVertex.of(v);
      m_next.hasClosedStar[v] =
          std::all_of(m_vertexLists[i].begin(), m_vertexLists[i].end(), areClosed) &&
          std::all_of(disabled.begin(), disabled.end(),
                      [&](const auto& held) { return areClosed(held.second); });
    }
    m_next.hasOnlyClosedStars = std::find(m_next.hasClosedStar.begin(), m_next.hasClosedStar.end(),
                                          0) == m_next.hasClosedStar.end();
  }

  const MeshTopology& m_before;
  std::span<const std::uint32_t> m_removed;
  std::span<const Triangle> m_added;
  MeshTopology m_next;
  Ids m_vertices;                       ///< affected, ascending
  CountedVector<Segment> m_edges;       ///< affected, ascending
  Ids m_edgesBefore;                    ///< of m_edges: their numbers before the cut, or kNoEdge
  CountedVector<std::uint8_t> m_stays;  ///< of m_edges: whether there is such an edge afterwards
  CountedVector<Ids> m_vertexLists, m_edgeLists;  ///< of both: enabled triangles after the cut
  Elements m_addedBy, m_disabledBy;
};

}  // namespace

MeshTopology cutTopology(const MeshTopology& before, std::span<const std::uint32_t> removed,
                         std::span<const Triangle> added, std::size_t vertexCount) {
  PALPATE_ASSERT(std::is_sorted(removed.begin(), removed.end()));
  PALPATE_ASSERT(vertexCount >= before.vertexCount);
  return TopologyCut(before, removed, added, vertexCount).run();
}

}  // namespace palpate
