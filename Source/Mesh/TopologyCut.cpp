// Part of Mesh/TriangleMesh.h: cuts of a topology.
#include "Mesh/TriangleMesh.h"

#include "Core/Assert.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace palpate {

namespace {

using Ids = CountedVector<std::uint32_t>;

template <class F>
void forEachEdge(const Triangle& t, F&& f) {
  for (std::size_t i = 0; i < 3; ++i) {
    const std::uint32_t p = t[i], q = t[(i + 1) % 3];
    if (p != q) f(Segment{std::min(p, q), std::max(p, q)}, i);
  }
}

}  // namespace

/// All that may throw comes before apply().
class TopologyCut {
 public:
  TopologyCut(MeshTopology& mesh, std::span<const std::uint32_t> removed,
              std::span<const Triangle> added, std::size_t vertexCount)
      : m_mesh(mesh),
        m_removed(removed),
        m_added(added),
        m_firstAdded(static_cast<std::uint32_t>(mesh.elements.size())),
        m_firstNewVertex(mesh.vertexCount),
        m_vertexCount(vertexCount),
        m_isRemoved(mesh.elements.size(), false) {
    for (const std::uint32_t t : removed) m_isRemoved[t] = true;
    findAffected();
    findLists();
    reserve();
  }

  EdgeChange edgeChange() const {
    EdgeChange change;
    for (const Edge& edge : m_edges)
      if (edge.stays != m_mesh.hasEdge(edge.id))
        (edge.stays ? change.added : change.gone).push_back(edge.vertices);
    return change;
  }

  void apply() noexcept {
    setOwners();  // takes them from the elements before the cut
    replaceElements();
    replaceEdges();
    replaceLists();
    setOwners();
    findClosedStars();
  }

 private:
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
      forEachEdge(t, [&](const Segment& edge, std::size_t) { byEdge.add(edge, element); });
    }
    void sort() { byVertex.sort(), byEdge.sort(); }
  };

  struct Vertex {
    std::uint32_t id;
    bool isUsed = false;  ///< afterwards
  };
  struct Edge {
    Segment vertices;
    std::uint32_t id;
    bool stays = false;
    auto key() const { return std::pair(vertices, id); }
  };

  bool isRemoved(std::uint32_t t) const { return m_isRemoved[t]; }
  std::uint32_t idOf(const Segment& vertices) const {
    return std::lower_bound(m_edges.begin(), m_edges.end(), vertices,
                            [](const Edge& edge, const Segment& v) { return edge.vertices < v; })
        ->id;
  }

  /// The vertices and edges of elements that are removed or added.
  void findAffected() {
    Ids vertices;
    for (const std::uint32_t t : m_removed) {
      vertices.insert(vertices.end(), m_mesh.elements[t].begin(), m_mesh.elements[t].end());
      for (const std::uint32_t e : m_mesh.triangleEdges[t])
        if (e != kNoEdge) m_edges.push_back({m_mesh.edges[e], e});
    }
    for (const Triangle& t : m_added) {
      vertices.insert(vertices.end(), t.begin(), t.end());
      forEachEdge(t, [&](const Segment& edge, std::size_t) { m_edges.push_back({edge, kNoEdge}); });
    }
    for (std::size_t v = m_firstNewVertex; v < m_vertexCount; ++v)
      vertices.push_back(static_cast<std::uint32_t>(v));
    sortUnique(vertices);
    m_vertices.reserve(vertices.size());
    for (const std::uint32_t v : vertices) m_vertices.push_back({v});
    // Of equal edges, those with known numbers come first.
    std::sort(m_edges.begin(), m_edges.end(),
              [](const Edge& l, const Edge& r) { return l.key() < r.key(); });
    m_edges.erase(
        std::unique(m_edges.begin(), m_edges.end(),
                    [](const Edge& l, const Edge& r) { return l.vertices == r.vertices; }),
        m_edges.end());
    auto newId = static_cast<std::uint32_t>(m_mesh.edges.size());
    for (Edge& edge : m_edges) {
      if (edge.id == kNoEdge) edge.id = m_mesh.findEdge(edge.vertices);
      if (edge.id == kNoEdge) edge.id = newId++;
    }
  }

  void findLists() {
    Elements added;
    for (std::size_t i = 0; i < m_added.size(); ++i)
      added.add(m_added[i], m_firstAdded + static_cast<std::uint32_t>(i));
    for (const std::uint32_t t : m_mesh.disabled)
      if (!isRemoved(t)) m_disabled.add(m_mesh.elements[t], t);
    added.sort(), m_disabled.sort();
    Ids list;
    const auto listAfter = [&](const IndexLists& before, std::uint32_t id, const auto& addedTo,
                               IndexLists& lists) {
      list.clear();
      if (id < before.size())
        for (const std::uint32_t t : before[id])
          if (!isRemoved(t)) list.push_back(t);
      for (const auto& [key, t] : addedTo) list.push_back(t);
      lists.append(list);
      return !list.empty();
    };
    for (Vertex& v : m_vertices)
      v.isUsed = listAfter(m_mesh.vertexTriangles, v.id, added.byVertex.of(v.id), m_vertexLists) ||
                 !m_disabled.byVertex.of(v.id).empty();
    for (Edge& e : m_edges)
      e.stays = listAfter(m_mesh.edgeTriangles, e.id, added.byEdge.of(e.vertices), m_edgeLists) ||
                !m_disabled.byEdge.of(e.vertices).empty();
  }

  void reserve() {
    const auto newEdges = static_cast<std::size_t>(
        std::count_if(m_edges.begin(), m_edges.end(),
                      [&](const Edge& edge) { return edge.id >= m_mesh.edges.size(); }));
    const std::size_t elements = m_firstAdded + m_added.size(),
                      edges = m_mesh.edges.size() + newEdges;
    reserveAmortized(m_mesh.elements, elements);
    reserveAmortized(m_mesh.triangleEdges, elements);
    reserveAmortized(m_mesh.owned, elements);
    reserveAmortized(m_mesh.isDisabled, elements);
    reserveAmortized(m_mesh.removed, m_mesh.removed.size() + m_removed.size());
    reserveAmortized(m_mesh.isUsed, m_vertexCount);
    reserveAmortized(m_mesh.hasClosedStar, m_vertexCount);
    reserveAmortized(m_mesh.edges, edges);
    reserveAmortized(m_mesh.m_isGone, edges);
    reserveAmortized(m_mesh.m_addedEdges, m_mesh.m_addedEdges.size() + newEdges);
    const auto reserveLists = [](IndexLists& lists, std::size_t newLists, const auto& affected,
                                 const IndexLists& after) {
      std::size_t items = 0;  // of lists that grow
      for (std::size_t i = 0; i < affected.size(); ++i)
        if (const std::uint32_t id = affected[i].id;
            id >= lists.size() || after[i].size() > lists[id].size())
          items += after[i].size();
      lists.reserveMore(newLists, items);
    };
    reserveLists(m_mesh.vertexTriangles, m_vertexCount - m_firstNewVertex, m_vertices,
                 m_vertexLists);
    reserveLists(m_mesh.edgeTriangles, edges - m_mesh.edges.size(), m_edges, m_edgeLists);
    m_newEdges.reserve(newEdges);
  }

  /// Takes the affected vertices and edges from their owners, or gives them to new ones.
  void setOwners() {
    const auto flip = [&](const IndexLists& lists, std::uint32_t id, const auto& heldBy,
                          auto&& bitOf) {
      if (id >= lists.size() || lists[id].empty()) return;
      const std::uint32_t owner = lists[id].front();
      const auto& held = heldBy[owner];
      const auto place = std::find(held.begin(), held.end(), id) - held.begin();
      PALPATE_ASSERT(place < 3);
      m_mesh.owned[owner] ^= static_cast<std::uint8_t>(bitOf(static_cast<int>(place)));
    };
    for (const Vertex& v : m_vertices)
      flip(m_mesh.vertexTriangles, v.id, m_mesh.elements, MeshTopology::cornerBit);
    for (const Edge& e : m_edges)
      flip(m_mesh.edgeTriangles, e.id, m_mesh.triangleEdges, MeshTopology::edgeBit);
  }

  void replaceElements() {
    const std::size_t size = m_firstAdded + m_added.size();
    if (!m_removed.empty()) m_mesh.isDisabled.resize(m_firstAdded, false);
    if (!m_mesh.isDisabled.empty()) m_mesh.isDisabled.resize(size, false);
    for (const std::uint32_t t : m_removed) {
      m_mesh.elements[t] = {0, 0, 0};
      m_mesh.triangleEdges[t] = {kNoEdge, kNoEdge, kNoEdge};
      m_mesh.isDisabled[t] = true;
    }
    insertSorted(m_mesh.removed, m_removed);
    std::erase_if(m_mesh.disabled, [&](std::uint32_t t) { return isRemoved(t); });
    for (const Triangle& t : m_added) {
      m_mesh.elements.push_back(t);
      auto& edges = m_mesh.triangleEdges.emplace_back();
      edges = {kNoEdge, kNoEdge, kNoEdge};
      forEachEdge(t, [&](const Segment& edge, std::size_t side) { edges[side] = idOf(edge); });
    }
    m_mesh.owned.resize(size, 0);
  }

  void replaceEdges() {
    for (const Edge& e : m_edges) {
      if (e.id >= m_mesh.edges.size()) {
        m_mesh.edges.push_back(e.vertices);
        m_newEdges.push_back(e.id);
      }
      if (!e.stays && m_mesh.m_isGone.empty()) m_mesh.m_isGone.resize(m_mesh.edges.size(), false);
      if (m_mesh.m_isGone.empty()) continue;
      m_mesh.m_isGone.resize(m_mesh.edges.size(), false);
      m_mesh.m_isGone[e.id] = !e.stays;
    }
    insertSorted(m_mesh.m_addedEdges, m_newEdges, [&](std::uint32_t l, std::uint32_t r) {
      return m_mesh.edges[l] < m_mesh.edges[r];
    });
  }

  void replaceLists() {
    const auto replace = [](IndexLists& lists, const auto& affected, const IndexLists& after) {
      for (std::size_t i = 0; i < affected.size(); ++i)
        if (affected[i].id < lists.size())
          lists.replace(affected[i].id, after[i]);
        else
          lists.append(after[i]);
    };
    for (std::size_t i = 0; i < m_vertices.size(); ++i) {
      const std::uint32_t v = m_vertices[i].id;
      m_mesh.untestedVertices += m_vertexLists[i].empty();
      m_mesh.untestedVertices -= v < m_firstNewVertex && m_mesh.vertexTriangles[v].empty();
    }
    replace(m_mesh.vertexTriangles, m_vertices, m_vertexLists);
    replace(m_mesh.edgeTriangles, m_edges, m_edgeLists);
    m_mesh.vertexCount = m_vertexCount;
    m_mesh.isUsed.resize(m_vertexCount, false);
    for (const Vertex& v : m_vertices) m_mesh.isUsed[v.id] = v.isUsed;
  }

  bool isClosed(std::uint32_t edge) const {
    const auto held = m_mesh.edgeTriangles[edge];
    if (held.size() != 2) return false;
    const auto isForward = [&](std::uint32_t t) {
      const auto& sides = m_mesh.triangleEdges[t];
      const auto side = std::find(sides.begin(), sides.end(), edge) - sides.begin();
      return m_mesh.elements[t][static_cast<std::size_t>(side)] == m_mesh.edges[edge][0];
    };
    return isForward(held[0]) != isForward(held[1]);
  }

  void findClosedStars() {
    m_mesh.hasClosedStar.resize(m_vertexCount, 1);
    // Every end of an affected edge is an affected vertex.
    for (const Vertex& v : m_vertices) {
      const auto areClosed = [&](std::uint32_t t) {
        const auto& sides = m_mesh.triangleEdges[t];
        return std::all_of(sides.begin(), sides.end(), [&](std::uint32_t e) {
          return e == kNoEdge || (m_mesh.edges[e][0] != v.id && m_mesh.edges[e][1] != v.id) ||
                 isClosed(e);
        });
      };
      const auto list = m_mesh.vertexTriangles[v.id];
      const auto disabled = m_disabled.byVertex.of(v.id);
      m_mesh.openStars -= m_mesh.hasClosedStar[v.id] == 0;
      m_mesh.hasClosedStar[v.id] =
          std::all_of(list.begin(), list.end(), areClosed) &&
          std::all_of(disabled.begin(), disabled.end(),
                      [&](const auto& held) { return areClosed(held.second); });
      m_mesh.openStars += m_mesh.hasClosedStar[v.id] == 0;
    }
  }

  MeshTopology& m_mesh;
  std::span<const std::uint32_t> m_removed;
  std::span<const Triangle> m_added;
  const std::uint32_t m_firstAdded;
  const std::size_t m_firstNewVertex, m_vertexCount;
  CountedVector<bool> m_isRemoved;        ///< per element before
  CountedVector<Vertex> m_vertices;       ///< affected, by their ids
  CountedVector<Edge> m_edges;            ///< affected, by their vertices
  IndexLists m_vertexLists, m_edgeLists;  ///< of these: enabled elements afterwards
  Ids m_newEdges;
  Elements m_disabled;  ///< disabled ones that stay
};

void MeshTopology::cut(std::span<const std::uint32_t> newlyRemoved, std::span<const Triangle> added,
                       std::size_t newVertexCount,
                       const std::function<void(const EdgeChange&)>& prepare) {
  PALPATE_ASSERT(std::is_sorted(newlyRemoved.begin(), newlyRemoved.end()));
  PALPATE_ASSERT(newVertexCount >= vertexCount);
  if (isLargeCut(newlyRemoved.size() + added.size(), count()))
    return cutAnew(newlyRemoved, added, newVertexCount, prepare);
  TopologyCut cut(*this, newlyRemoved, added, newVertexCount);
  if (prepare) prepare(cut.edgeChange());
  cut.apply();
}

void MeshTopology::cutAnew(std::span<const std::uint32_t> newlyRemoved,
                           std::span<const Triangle> added, std::size_t newVertexCount,
                           const std::function<void(const EdgeChange&)>& prepare) {
  CountedVector<Triangle> all;
  all.reserve(elements.size() + added.size());
  all.assign(elements.begin(), elements.end());
  all.insert(all.end(), added.begin(), added.end());
  Ids allRemoved(removed.size() + newlyRemoved.size()), stillDisabled;
  std::merge(removed.begin(), removed.end(), newlyRemoved.begin(), newlyRemoved.end(),
             allRemoved.begin());
  std::set_difference(disabled.begin(), disabled.end(), newlyRemoved.begin(), newlyRemoved.end(),
                      std::back_inserter(stillDisabled));
  MeshTopology after(newVertexCount, all, allRemoved);
  after.type = type;
  if (!stillDisabled.empty()) after.disable(stillDisabled);
  if (prepare) {
    CountedVector<Segment> before;
    forEachEdge([&](std::uint32_t e) { before.push_back(edges[e]); });
    std::sort(before.begin(), before.end());
    EdgeChange change;
    const auto subtract = [](const auto& from, const auto& those, auto& result) {
      std::set_difference(from.begin(), from.end(), those.begin(), those.end(),
                          std::back_inserter(result));
    };
    subtract(before, after.edges, change.gone);
    subtract(after.edges, before, change.added);
    prepare(change);
  }
  *this = std::move(after);
}

}  // namespace palpate
