#pragma once

#include <palpate/Types.h>

#include "Core/Buffer.h"
#include "Mesh/Positions.h"

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

constexpr std::uint32_t kNoEdge = 0xffffffffu;

/// Lists of different lengths in one array: list i is items[offsets[i]] to items[offsets[i + 1]].
struct IndexLists {
  std::vector<std::uint32_t> offsets{0};
  std::vector<std::uint32_t> items;
  std::span<const std::uint32_t> operator[](std::size_t i) const {
    return std::span(items).subspan(offsets[i], offsets[i + 1] - offsets[i]);
  }
};

/// Lists per key from (key, item) incidences, which come in ascending order of items.
template <class ForEach>
IndexLists listsByKey(std::size_t keyCount, ForEach&& forEachIncidence) {
  IndexLists lists;
  lists.offsets.assign(keyCount + 1, 0);
  forEachIncidence([&](std::uint32_t key, std::uint32_t) { ++lists.offsets[key + 1]; });
  for (std::size_t i = 0; i < keyCount; ++i) lists.offsets[i + 1] += lists.offsets[i];
  lists.items.resize(lists.offsets.back());
  std::vector<std::uint32_t> next(lists.offsets.begin(), lists.offsets.end() - 1);
  forEachIncidence([&](std::uint32_t key, std::uint32_t item) { lists.items[next[key]++] = item; });
  return lists;
}

/// What follows from the triangles alone, computed once.
///
/// Each vertex and each edge is owned by the lowest triangle that is on and holds it, so that of
/// all the triangle pairs that a feature pair lies in exactly one tests it. (Curtis et al., Fast
/// collision detection for deformable models using representative-triangles, I3D 2008.)
struct MeshTopology {
  MeshTopology() = default;
  /// Indices must be below vertexCount.
  MeshTopology(std::size_t vertexCount, std::span<const Triangle> triangles);

  GeometryKind kind = GeometryKind::Triangles;
  std::size_t vertexCount = 0;
  std::vector<Triangle> triangles;
  std::vector<Segment> edges;  ///< unique, lower vertex first, sorted
  /// Edge i joins corners i and i + 1 mod 3; kNoEdge where these are the same vertex.
  std::vector<std::array<std::uint32_t, 3>> triangleEdges;
  std::vector<std::uint8_t> owned;   ///< per triangle: its cornerBit()s and edgeBit()s
  IndexLists vertexTriangles;        ///< that are on: ascending triangle ids, each once
  IndexLists edgeTriangles;          ///< the same; none: the edge is off
  std::size_t untestedVertices = 0;  ///< in no triangle that is on
  std::vector<bool> isUsed;          ///< per vertex: in a triangle, on or off
  /// Per vertex: each of its edges is in two triangles that are on, in opposite directions.
  std::vector<std::uint8_t> hasClosedStar;
  std::vector<std::uint32_t> disabled{};  ///< triangles that are off, ascending
  std::vector<bool> isDisabled{};         ///< the same by triangle; empty if none is
  std::optional<bool> closed;             ///< and consistently oriented; once asked

  /// Disables these triangles and enables all others. Changes nothing if it throws.
  /// Cost     linear: about a tenth of the constructor's.
  void disable(std::span<const std::uint32_t> triangles);
  bool isOn(std::uint32_t triangle) const { return isDisabled.empty() || !isDisabled[triangle]; }

  /// Of an edge, lower vertex first; kNoEdge if there is none such.
  std::uint32_t edgeOf(const Segment& edge) const;
  /// Others' vertices are tested against triangles with faces only.
  bool hasFaces() const { return kind == GeometryKind::Triangles; }
  static constexpr unsigned cornerBit(int corner) { return 1u << corner; }
  static constexpr unsigned edgeBit(int edge) { return 1u << (3 + edge); }
  bool ownsCorner(std::uint32_t triangle, int corner) const {
    return owned[triangle] & cornerBit(corner);
  }
  bool ownsEdge(std::uint32_t triangle, int edge) const { return owned[triangle] & edgeBit(edge); }

 private:
  void findOwners(const std::vector<bool>& isDisabled);
};

/// Whether vertices of one mesh of a pair are tested against what the other is made of. Of two
/// point sets those of the first are.
inline bool areTested(const MeshTopology& vertices, const MeshTopology& others, bool ofFirst) {
  return others.hasFaces() ||
         (vertices.kind == GeometryKind::Points && (others.kind == GeometryKind::Lines || ofFirst));
}

inline bool shareVertex(const Segment& a, const Segment& b) {
  return a[0] == b[0] || a[0] == b[1] || a[1] == b[0] || a[1] == b[1];
}

/// A mesh as handed in: topology once, positions per frame. A segment is the triangle {p, q, q}, a
/// point {p, p, p}.
struct TriangleMesh {
  MeshTopology topology;
  Positions now;
  Positions before;
  std::vector<double> radii{};          ///< L, per vertex; empty: all have the largest
  double largestRadius = 0.0;           ///< L
  std::vector<Eigen::Vector3d> rest{};  ///< when the topology was set
  bool outer = false;                   ///< Sidedness::Outer

  double radius(std::uint32_t vertex) const {
    return radii.empty() ? largestRadius : radii[vertex];
  }
  /// At p0 + weight (p1 - p0).
  double radius(const Segment& edge, double weight) const {
    if (radii.empty()) return largestRadius;
    return (1.0 - weight) * radii[edge[0]] + weight * radii[edge[1]];
  }
  double radius(const Triangle& corners, const Eigen::Vector3d& barycentric) const {
    if (radii.empty()) return largestRadius;
    return barycentric[0] * radii[corners[0]] + barycentric[1] * radii[corners[1]] +
           barycentric[2] * radii[corners[2]];
  }
};

}  // namespace palpate
