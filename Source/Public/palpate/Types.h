#pragma once

#include <palpate/Export.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Identifies a geometry of one OctreeBasedCD. An id is never given out twice.
enum class GeometryId : std::uint32_t {};

inline constexpr std::uint32_t kNoElement = 0xffffffff;  ///< no element or vertex, as in a shape

/// The surface of a tetrahedral mesh consists of Triangles. A Shape and a Field have no elements.
enum class GeometryType : std::uint8_t { Triangles, Lines, Points, Shape, Field };
PALPATE_EXPORT const char* toString(GeometryType) noexcept;  ///< its name, or "unknown"

/// Three vertex indices. The winding gives the normal: (b - a) x (c - a) for the corners a, b, c.
using Triangle = std::array<std::uint32_t, 3>;
/// Two vertex indices. The edge of a mesh has the lower index first.
using Segment = std::array<std::uint32_t, 2>;
/// Four vertex indices in any order.
using Tetrahedron = std::array<std::uint32_t, 4>;

/// Two triangles, segments or points: `a` of the pair's first geometry, `b` of the second.
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

  /// The point in the world, rounded as it is written: ((r0 x + r1 y) + r2 z) + t.
  Eigen::Vector3d operator()(const Eigen::Vector3d& p) const {
    const auto row = [&](int k) {
      return rotation(k, 0) * p[0] + rotation(k, 1) * p[1] + rotation(k, 2) * p[2] + translation[k];
    };
    return {row(0), row(1), row(2)};
  }
  friend bool operator==(const Pose& l, const Pose& r) {
    return l.rotation == r.rotation && l.translation == r.translation;
  }
};

/// The motion of a rigid body in a step; by default of one that setTransform() never placed.
struct RigidMotion {
  Pose before, now;
};

/// A mesh in the caller's memory, of which a call keeps no reference.
struct TriangleMeshView {
  std::span<const Eigen::Vector3d> positions;  ///< L
  std::span<const Triangle> triangles;
};

struct Welded {
  std::vector<Eigen::Vector3d> positions;  ///< L
  std::vector<Triangle> triangles;         ///< as many as were given, in their order
  std::vector<std::uint32_t> vertexOf;     ///< for each vertex that was given, its new index
};
/// Joins vertices, such as those of an STL file, so that triangles become neighbours. A triangle
/// with two joined corners names a vertex twice, and counts for nothing.
/// distance L: a vertex joins the first earlier one that stayed within it. With 0 equal positions
///          join; with more the result may depend on the order of vertices.
/// Errors   NonFinitePosition, IndexOutOfRange, TooLarge; InvalidSettings for the distance.
/// Cost     linear, some 0.2 microseconds a vertex.
PALPATE_EXPORT Welded weld(std::span<const Eigen::Vector3d> positions,
                           std::span<const Triangle> triangles, double distance = 0.0);

}  // namespace palpate
