#pragma once

#include <palpate/Types.h>

#include "Mesh/Positions.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace palpate {

constexpr std::uint32_t kNoEdge = 0xffffffffu;

/// Lists of different lengths in one array.
class IndexLists {
 public:
  IndexLists() = default;
  /// List i is items[offsets[i]] to items[offsets[i + 1]].
  IndexLists(std::span<const std::uint32_t> offsets, CountedVector<std::uint32_t> items);

  std::size_t size() const { return m_ranges.size(); }
  std::span<const std::uint32_t> operator[](std::size_t i) const {
    PALPATE_ASSERT(i < m_ranges.size());
    return std::span(m_items).subspan(m_ranges[i].begin, m_ranges[i].size);
  }
  std::size_t itemCount() const { return m_items.size() - m_lost; }
  std::size_t bytes() const;

  /// Makes room, so that append() and replace() of so many lists and items do not throw.
  /// Cost     linear from time to time, amortized by the lists and items that are added.
  void reserveMore(std::size_t lists, std::size_t items);
  void append(std::span<const std::uint32_t> list);
  void replace(std::size_t i, std::span<const std::uint32_t> list);

 private:
  struct Range {
    std::uint32_t begin, size;
  };
  CountedVector<Range> m_ranges;
  CountedVector<std::uint32_t> m_items;
  std::size_t m_lost = 0;  ///< items of lists that were replaced
};

/// Builds lists per key from (key, item) incidences, which must come in ascending order of items.
template <class ForEach>
IndexLists listsByKey(std::size_t keyCount, ForEach&& forEachIncidence) {
  CountedVector<std::uint32_t> offsets(keyCount + 1, 0);
  forEachIncidence([&](std::uint32_t key, std::uint32_t) { ++offsets[key + 1]; });
  for (std::size_t i = 0; i < keyCount; ++i) offsets[i + 1] += offsets[i];
  CountedVector<std::uint32_t> items, next(offsets.begin(), offsets.end() - 1);
  items.reserve(withSpare(offsets.back()));
  items.resize(offsets.back());
  forEachIncidence([&](std::uint32_t key, std::uint32_t item) {
    PALPATE_ASSERT(next[key] == offsets[key] || items[next[key] - 1] <= item);
    items[next[key]++] = item;
  });
  return {offsets, std::move(items)};
}

/// Calls f(id) for the ids below `size`, ascending, without those of the list, which ascends.
template <class F>
void forEachWithout(std::size_t size, std::span<const std::uint32_t> without, F&& f) {
  auto next = without.begin();
  for (std::uint32_t id = 0; id < size; ++id)
    if (next != without.end() && *next == id)
      ++next;
    else
      f(id);
}

/// Whether a cut that removes or adds so many elements costs more than to compute anew what follows
/// from the elements that are left.
constexpr bool isLargeCut(std::size_t changed, std::size_t elements) {
  return changed > elements / 8;
}

/// The edges that a cut removes and adds, sorted.
struct EdgeChange {
  CountedVector<Segment> gone, added;
};

/// The connectivity of a mesh, which follows from its elements alone. It is computed once, and
/// changed where a cut changes the elements.
///
/// Each vertex and each edge is owned by the lowest enabled triangle that contains it. Exactly one
/// of all the triangle pairs that contain a feature pair therefore tests it. (Curtis et al., Fast
/// collision detection for deformable models using representative-triangles, I3D 2008.)
struct MeshTopology {
  MeshTopology() = default;
  /// Indices must be below vertexCount. removed: ascending.
  MeshTopology(std::size_t vertexCount, std::span<const Triangle> elements,
               std::span<const std::uint32_t> removed = {});

  GeometryType type = GeometryType::Triangles;
  std::size_t vertexCount = 0;
  CountedVector<Triangle> elements;  ///< triangle {p, q, r}, segment {p, q, q}, point {p, p, p}
  /// Unique, lower vertex first, and sorted, but for those that cuts added behind them. An edge
  /// keeps its number in small cuts, also while no element has it: see forEachEdge().
  CountedVector<Segment> edges;
  /// Edge i joins corners i and i + 1 mod 3; kNoEdge if both are the same vertex.
  CountedVector<std::array<std::uint32_t, 3>> triangleEdges;
  CountedVector<std::uint8_t> owned;  ///< per triangle: its cornerBit()s and edgeBit()s
  IndexLists vertexTriangles;         ///< enabled elements only: ascending ids, each once
  IndexLists edgeTriangles;           ///< the same; an empty list: the edge is disabled
  std::size_t untestedVertices = 0;   ///< number of vertices in no enabled triangle
  CountedVector<bool> isUsed;         ///< per vertex: in a triangle that is there, enabled or not
  /// Per vertex: each of its edges is in exactly two enabled triangles, in opposite directions.
  CountedVector<std::uint8_t> hasClosedStar;
  std::size_t openStars = 0;  ///< vertices of which hasClosedStar is 0
  /// Elements that cuts removed, ascending. They have corners 0, no edges, are in no list and no
  /// octree, and count as disabled.
  CountedVector<std::uint32_t> removed{};
  CountedVector<std::uint32_t> disabled{};  ///< disabled elements that were not removed, ascending
  CountedVector<bool> isDisabled{};  ///< per triangle, with removed ones; empty if there are none

  /// The elements after a cut: these are removed, in ascending order, and others are added. The
  /// topology equals one that is constructed anew, but for the numbers of edges. prepare: called
  /// before anything changes; may throw. Changes nothing if it throws.
  /// Cost     searches for what is around the cut, after one sort of it. Linear parts are moves of
  ///          ids that cuts removed or added, a look at disabled elements, and, amortized by what
  ///          is added, copies of arrays that have to grow. A large cut costs a topology
  ///          constructed anew, and numbers the edges again.
  void cut(std::span<const std::uint32_t> removed, std::span<const Triangle> added,
           std::size_t newVertexCount,
           const std::function<void(const EdgeChange&)>& prepare = nullptr);

  /// Whether the enabled triangles are a closed surface.
  bool hasOnlyClosedStars() const { return openStars == 0; }
  std::size_t count() const { return elements.size() - removed.size(); }  ///< without removed ones
  bool isRemoved(std::uint32_t element) const {
    return std::binary_search(removed.begin(), removed.end(), element);
  }
  /// Calls f(element) for those that were not removed, ascending.
  template <class F>
  void forEachElement(F&& f) const {
    forEachWithout(elements.size(), removed, f);
  }
  std::uint32_t lowest() const;  ///< the lowest element that was not removed; there is one
  /// Disables these elements and enables all others. Changes nothing if it throws.
  /// Cost     linear: about a tenth of the constructor's.
  void disable(std::span<const std::uint32_t> elements);
  bool isEnabled(std::uint32_t triangle) const {
    return isDisabled.empty() || !isDisabled[triangle];
  }

  /// The index of an edge, whose lower vertex comes first; kNoEdge if there is no such edge.
  std::uint32_t edgeOf(const Segment& edge) const;
  /// Calls f(edge) for the edges of elements that were not removed, disabled or not.
  template <class F>
  void forEachEdge(F&& f) const {
    for (std::uint32_t e = 0; e < edges.size(); ++e)
      if (hasEdge(e)) f(e);
  }
  bool hasEdge(std::uint32_t edge) const {
    return edge < edges.size() && (m_isGone.empty() || !m_isGone[edge]);
  }
  bool hasAddedEdges() const {
    return !m_addedEdges.empty();
  }  ///< then precedes() is not the order of numbers
  /// Whether the vertices of edge e come before those of edge f, in lexicographic order.
  bool precedes(std::uint32_t e, std::uint32_t f) const {
    return std::max(e, f) < sortedEdges() ? e < f : edges[e] < edges[f];
  }
  /// Whether elements have faces. Vertices of other meshes are tested only against triangles with
  /// faces.
  bool hasFaces() const { return type == GeometryType::Triangles; }
  static constexpr unsigned cornerBit(int corner) { return 1u << corner; }
  static constexpr unsigned edgeBit(int edge) { return 1u << (3 + edge); }
  bool ownsCorner(std::uint32_t triangle, int corner) const {
    return owned[triangle] & cornerBit(corner);
  }
  bool ownsEdge(std::uint32_t triangle, int edge) const { return owned[triangle] & edgeBit(edge); }

 private:
  friend class TopologyCut;
  void cutAnew(std::span<const std::uint32_t> removed, std::span<const Triangle> added,
               std::size_t newVertexCount, const std::function<void(const EdgeChange&)>& prepare);
  void findOwners(const CountedVector<bool>& isDisabled);
  std::size_t sortedEdges() const { return edges.size() - m_addedEdges.size(); }
  /// The index of an edge, also of one that is gone.
  std::uint32_t findEdge(const Segment& edge) const;

  CountedVector<std::uint32_t> m_addedEdges;  ///< those of cuts, in the order of their vertices
  CountedVector<bool> m_isGone;  ///< per edge: no element has it; empty if there is none
};

/// Whether the vertices of one mesh of a pair are tested against the other mesh's elements.
/// isFirstMesh: the vertices are the first mesh's; of two point sets, only these are tested.
inline bool areTested(const MeshTopology& vertices, const MeshTopology& others, bool isFirstMesh) {
  return others.hasFaces() || (vertices.type == GeometryType::Points &&
                               (others.type == GeometryType::Lines || isFirstMesh));
}

inline bool shareVertex(const Segment& a, const Segment& b) {
  return a[0] == b[0] || a[0] == b[1] || a[1] == b[0] || a[1] == b[1];
}

/// A mesh as the caller defined it: its topology, set once, and its positions, set per frame. A
/// segment is the triangle {p, q, q}, a point is {p, p, p}.
struct TriangleMesh {
  MeshTopology topology;
  Positions now;
  Positions before;
  CountedVector<double> radii{};          ///< L, per vertex; empty: all have the largest radius
  double largestRadius = 0.0;             ///< L
  CountedVector<Eigen::Vector3d> rest{};  ///< positions when the topology was set
  bool outerSideOnly = false;             ///< Sidedness::Outer
  /// Per element, or one of what has no elements; empty: all are 0.
  CountedVector<std::uint32_t> tags{};

  std::uint32_t tag(std::uint32_t element) const { return tags.empty() ? 0 : tags[element]; }
  /// That of the lowest enabled element that holds the feature.
  std::uint32_t tagOfVertex(std::uint32_t vertex) const {
    return tags.empty() ? 0 : tagOfLowest(topology.vertexTriangles[vertex]);
  }
  std::uint32_t tagOfEdge(const Segment& edge) const {
    return tags.empty() ? 0 : tagOfLowest(topology.edgeTriangles[topology.edgeOf(edge)]);
  }

  double radius(std::uint32_t vertex) const {
    PALPATE_ASSERT(radii.empty() || vertex < radii.size());
    return radii.empty() ? largestRadius : radii[vertex];
  }
  /// The radius at p0 + weight (p1 - p0).
  double radius(const Segment& edge, double weight) const {
    if (radii.empty()) return largestRadius;
    return (1.0 - weight) * radii[edge[0]] + weight * radii[edge[1]];
  }
  double radius(const Triangle& corners, const Eigen::Vector3d& weights) const {
    if (radii.empty()) return largestRadius;
    return weights[0] * radii[corners[0]] + weights[1] * radii[corners[1]] +
           weights[2] * radii[corners[2]];
  }

 private:
  std::uint32_t tagOfLowest(std::span<const std::uint32_t> elements) const {
    return elements.empty() ? 0 : tags[elements.front()];
  }
};

}  // namespace palpate
