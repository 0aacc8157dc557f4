#pragma once

#include <palpate/Types.h>

#include "Core/Buffer.h"

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
  bool ownsCorner(std::uint32_t triangle, int corner) const {
    return owned[triangle] >> corner & 1;
  }
  bool ownsEdge(std::uint32_t triangle, int edge) const {
    return owned[triangle] >> (3 + edge) & 1;
  }
};

/// A triangle mesh as handed in: topology once, positions per frame.
struct TriangleMesh {
  MeshTopology topology;
  std::vector<Eigen::Vector3d> now;
  std::vector<Eigen::Vector3d> before;
};

}  // namespace palpate
