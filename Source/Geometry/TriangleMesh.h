#pragma once

#include <palpate/Types.h>

#include "Core/Buffer.h"
#include "Geometry/Thread.h"

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

/// What follows from the triangles alone, computed once.
///
/// Each vertex and each edge is owned by the lowest triangle that holds it, so that of all the
/// triangle pairs that a feature pair lies in exactly one tests it. (Curtis et al., Fast collision
/// detection for deformable models using representative-triangles, I3D 2008.)
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
  std::vector<std::uint8_t> owned;   ///< per triangle: bit i: owns corner i; bit 3 + i: owns edge i
  IndexLists vertexTriangles;        ///< ascending triangle ids, each once
  IndexLists edgeTriangles;          ///< ascending triangle ids, each once
  std::size_t untestedVertices = 0;  ///< in no triangle
  std::optional<bool> closed;        ///< and consistently oriented; once asked

  /// Of an edge, lower vertex first; kNoEdge if there is none such.
  std::uint32_t edgeOf(const Segment& edge) const;
  /// Others' vertices are tested against triangles with faces only.
  bool hasFaces() const { return kind == GeometryKind::Triangles; }
  bool ownsCorner(std::uint32_t triangle, int corner) const {
    return owned[triangle] >> corner & 1;
  }
  bool ownsEdge(std::uint32_t triangle, int edge) const {
    return owned[triangle] >> (3 + edge) & 1;
  }
};

inline bool shareVertex(const Segment& a, const Segment& b) {
  return a[0] == b[0] || a[0] == b[1] || a[1] == b[0] || a[1] == b[1];
}

/// A mesh as handed in: topology once, positions per frame. A segment is the triangle {p, q, q}, a
/// point {p, p, p}.
struct TriangleMesh {
  MeshTopology topology;
  std::vector<Eigen::Vector3d> now;
  std::vector<Eigen::Vector3d> before;
  std::vector<double> radii{};          ///< L, per vertex; empty: all have the largest
  double largestRadius = 0.0;           ///< L
  std::vector<Eigen::Vector3d> rest{};  ///< of lines: when they were added
  std::vector<ThreadArc> arcs{};        ///< of lines without branches: per edge

  double radius(std::uint32_t vertex) const {
    return radii.empty() ? largestRadius : radii[vertex];
  }
  /// At p0 + weight (p1 - p0).
  double radius(const Segment& edge, double weight) const {
    if (radii.empty()) return largestRadius;
    return (1.0 - weight) * radii[edge[0]] + weight * radii[edge[1]];
  }
};

}  // namespace palpate
