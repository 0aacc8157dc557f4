#pragma once

#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Triangles in spheres, for lanes. Sphere centres are points of the triangles.
struct ProxyItems {
  Buffer<double> x, y, z, radius;  ///< L
  /// A unit normal within kProxyNormalError; 0 if there is none, or if an edge at a corner of the
  /// triangle is not in exactly two triangles, in opposite directions.
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

/// Finds planes that stand for the surface in nodes, and proves their errors
/// (Docs/SurfaceProxies.md).
class ProxyPlanes {
 public:
  struct Plane {
    Eigen::Vector3d normal;
    double offset, error;  ///< L
  };
  /// What is known when a plane is looked for.
  struct Surroundings {
    const ProxyItems& items;  ///< all triangles within `reach` of the centre, or more
    ProxyCube cube;
    double reach;             ///< L: |centre - nearest| + 2 halfDiagonal, at least
    Eigen::Vector3d nearest;  ///< a surface point
  };
  /// Of one task.
  struct Scratch {
    Buffer<std::uint32_t> places;
    Buffer<double> low, high;
  };

  /// rounding: L, of the lengths that are computed.
  ProxyPlanes(const MeshTopology&, std::span<const Eigen::Vector3d> positions, double allowedError,
              double normalCone, double rounding);

  ProxyItems itemsOfAll() const;
  bool find(const Surroundings&, Plane&, Scratch&) const;

 private:
  struct Shadow;
  struct Window;
  Shadow shadowOf(std::uint32_t triangle, const Window&) const;
  Eigen::Vector3d normalNear(const Surroundings&, Scratch&) const;
  bool isInCone(std::uint32_t triangle, const Eigen::Vector3d& normal) const;
  bool findHeights(const Surroundings&, const Window&, double& low, double& high, Scratch&) const;
  bool isNearestInside(const Surroundings&, const Window&, double middle, double& error,
                       Scratch&) const;
  bool isFarEnough(const Shadow&, const Window&, double middle, double error) const;

  const MeshTopology& m_topology;
  const std::span<const Eigen::Vector3d> m_positions;
  const double m_allowedError, m_cosine, m_rounding;
  CountedVector<Eigen::Vector3d> m_normals;  ///< per triangle, with twice its area as length
};

}  // namespace palpate
