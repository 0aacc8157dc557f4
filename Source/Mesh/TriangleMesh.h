#pragma once

#include <palpate/Types.h>

#include "Mesh/Positions.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

constexpr std::uint32_t kNoEdge = 0xffffffffu;

/// Lists of different lengths in one array: list i is items[offsets[i]] to items[offsets[i + 1]].
struct IndexLists {
  CountedVector<std::uint32_t> offsets{0};
  CountedVector<std::uint32_t> items;
  std::span<const std::uint32_t> operator[](std::size_t i) const {
    PALPATE_ASSERT(i + 1 < offsets.size());
    return std::span(items).subspan(offsets[i], offsets[i + 1] - offsets[i]);
  }
};

/// Builds lists per key from (key, item) incidences, which must come in ascending order of items.
template <class ForEach>
IndexLists listsByKey(std::size_t keyCount, ForEach&& forEachIncidence) {
  IndexLists lists;
  lists.offsets.assign(keyCount + 1, 0);
  forEachIncidence([&](std::uint32_t key, std::uint32_t) { ++lists.offsets[key + 1]; });
  for (std::size_t i = 0; i < keyCount; ++i) lists.offsets[i + 1] += lists.offsets[i];
  lists.items.resize(lists.offsets.back());
  CountedVector<std::uint32_t> next(lists.offsets.begin(), lists.offsets.end() - 1);
  forEachIncidence([&](std::uint32_t key, std::uint32_t item) {
    PALPATE_ASSERT(next[key] == lists.offsets[key] || lists.items[next[key] - 1] <= item);
    lists.items[next[key]++] = item;
  });
  return lists;
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

/// The connectivity of a mesh, which follows from its elements alone and is computed once.
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
  CountedVector<Segment> edges;      ///< unique, lower vertex first, sorted
  /// Edge i joins corners i and i + 1 mod 3; kNoEdge if both are the same vertex.
  CountedVector<std::array<std::uint32_t, 3>> triangleEdges;
  CountedVector<std::uint8_t> owned;  ///< per triangle: its cornerBit()s and edgeBit()s
  IndexLists vertexTriangles;         ///< enabled elements only: ascending ids, each once
  IndexLists edgeTriangles;           ///< the same; an empty list: the edge is disabled
  std::size_t untestedVertices = 0;   ///< number of vertices in no enabled triangle
  CountedVector<bool> isUsed;         ///< per vertex: in a triangle that is there, enabled or not
  /// Per vertex: each of its edges is in exactly two enabled triangles, in opposite directions.
  CountedVector<std::uint8_t> hasClosedStar;
  bool hasOnlyClosedStars = true;  ///< the enabled triangles are a closed surface
  /// Elements that cuts removed, ascending. They have corners 0, no edges, are in no list and no
  /// octree, and count as disabled.
  CountedVector<std::uint32_t> removed{};
  CountedVector<std::uint32_t> disabled{};  ///< disabled elements that were not removed, ascending
  CountedVector<bool> isDisabled{};  ///< per triangle, with removed ones; empty if there are none

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
  void findOwners(const CountedVector<bool>& isDisabled);
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
