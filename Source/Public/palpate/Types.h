#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// Identifies a geometry of one OctreeBasedCD. An id is never given out twice, also after its
/// geometry was removed.
enum class GeometryId : std::uint32_t {};

/// Stands for the index of an element or vertex where there is none, as in a shape.
inline constexpr std::uint32_t kNoElement = 0xffffffff;

/// The geometry type: what the elements of a geometry are. The surface of a tetrahedral mesh
/// consists of Triangles. A Shape is an analytical shape, a Field a distance field; these have no
/// elements.
enum class GeometryType : std::uint8_t { Triangles, Lines, Points, Shape, Field };

/// Three vertex indices. The winding gives the normal: (b - a) x (c - a) for the corners a, b, c.
using Triangle = std::array<std::uint32_t, 3>;
/// Two vertex indices. The edge of a mesh has the lower index first.
using Segment = std::array<std::uint32_t, 2>;
/// Four vertex indices in any order.
using Tetrahedron = std::array<std::uint32_t, 4>;

/// Two elements, each by its index in its geometry. An element is a triangle, a segment or a point.
/// `a` belongs to the first geometry of the pair, `b` to the second.
struct ElementPair {
  std::uint32_t a;
  std::uint32_t b;
  friend bool operator==(const ElementPair&, const ElementPair&) = default;
  friend auto operator<=>(const ElementPair&, const ElementPair&) = default;
};

/// A rigid placement: a point x of the body's frame is at rotation x + translation in the world.
struct Pose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< L
};

/// A triangle mesh that stays in the caller's memory. A call that takes a view reads it and keeps
/// no reference to it.
struct TriangleMeshView {
  std::span<const Eigen::Vector3d> positions;  ///< L
  std::span<const Triangle> triangles;
};

}  // namespace palpate
