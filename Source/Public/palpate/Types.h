#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// A geometry of one OctreeBasedCD. Given out once, never reused.
enum class GeometryId : std::uint32_t {};

/// What a geometry's elements are.
enum class GeometryKind : std::uint8_t { Triangles, Lines, Points, Shape };

using Triangle = std::array<std::uint32_t, 3>;  ///< vertex indices; winding gives the normal
/// vertex indices, lower first where it is an edge of a mesh
using Segment = std::array<std::uint32_t, 2>;
/// vertex indices, in any order
using Tetrahedron = std::array<std::uint32_t, 4>;

/// Two elements (triangles, segments or points) by index in their geometries; `a` from the pair's
/// first.
struct ElementPair {
  std::uint32_t a;
  std::uint32_t b;
  friend bool operator==(const ElementPair&, const ElementPair&) = default;
  friend auto operator<=>(const ElementPair&, const ElementPair&) = default;
};

/// A mesh that stays with its owner, for calls that need it only once.
struct TriangleMeshView {
  std::span<const Eigen::Vector3d> positions;
  std::span<const Triangle> triangles;
};

}  // namespace palpate
