#pragma once

#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// rad. A cross product of two edges has an error below 2^-50 of the square of the longest edge, so
/// that the direction has one below 2^-30.
inline constexpr double kProxyNormalError = 0x1p-30;

/// Triangles in spheres, for lanes. Sphere centres are points of the triangles.
struct ProxyItems {
  Buffer<double> x, y, z, radius;  ///< L
  /// A unit normal within kProxyNormalError; 0 if there is none, or without hasClosedStars().
  Buffer<double> normalX, normalY, normalZ;
  Buffer<double> triangle;  ///< its index; a double, to move with the others
  std::size_t size = 0;

  void reserve(std::size_t count);  ///< leaves the contents undefined
  void append(const ProxyItems& from, std::size_t i);
  Eigen::Vector3d centre(std::size_t i) const { return {x[i], y[i], z[i]}; }
  std::uint32_t triangleAt(std::size_t i) const { return static_cast<std::uint32_t>(triangle[i]); }
};

/// A node of the octree of a proxy. Its sizes have a margin for rounding.
struct ProxyCube {
  Eigen::Vector3d centre;
  double half, halfDiagonal;  ///< L: half the edge, and half the diagonal
};

/// The column in which a plane is looked for, about a node's centre: axes u and v, and the normal.
struct ProxyWindow {
  ProxyCube cube;
  Eigen::Vector3d u, v, normal;
  Eigen::Vector3d footprint;   ///< L: half sizes of the node along the axes
  double more;                 ///< L, by which the window exceeds the footprint
  std::array<double, 2> half;  ///< L: half sizes of the window
};

/// The enabled triangles. rounding: L, of the lengths that are computed.
ProxyItems itemsOf(const MeshTopology&, std::span<const Eigen::Vector3d> positions,
                   double rounding);
/// Whether every edge at the triangle's corners is in exactly two triangles, in opposite
/// directions.
bool hasClosedStars(const MeshTopology&, std::uint32_t triangle);

/// The least square of the distances of sphere centres from a point, and whether any sphere is
/// within `near` of it.
struct NearestItem {
  double square;
  bool isNear;
};
NearestItem nearestOf(const ProxyItems&, const Eigen::Vector3d& point, double near);
/// Copies the items within `reach` of the point. Returns the place in `to` of the first one whose
/// centre has the least square of the distance, which must be among them.
std::size_t keepWithin(const ProxyItems& from, const Eigen::Vector3d& point, double reach,
                       double leastSquare, ProxyItems& to);
/// Writes the places of the items within `reach` of the point. Returns their number.
std::size_t placesWithin(const ProxyItems&, const Eigen::Vector3d& point, double reach,
                         std::uint32_t* places);
/// The same of the triangles that may reach into the window, with bounds of their heights there;
/// infinite bounds where the normal may be outside the cone.
std::size_t boundHeights(const ProxyItems&, const ProxyWindow&, double leastCosine, double rounding,
                         std::uint32_t* places, double* lows, double* highs);
/// Raises `error` as far as the triangles' spheres and normals need it for condition 4
/// (Docs/SurfaceProxies.md), to at most `most`. Writes the places of those that need more, and
/// returns their number. height: L, of the plane above the window's centre.
std::size_t raiseError(const ProxyItems&, const ProxyWindow&, double height, double most,
                       double rounding, double& error, std::uint32_t* places);

}  // namespace palpate
