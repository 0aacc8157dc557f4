#pragma once

#include "DistanceField/ProxyItems.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"

#include <Eigen/Core>

#include <cstdint>
#include <span>

namespace palpate {

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

  bool find(const Surroundings&, Plane&, Scratch&) const;

 private:
  struct Shadow;
  Shadow shadowOf(std::uint32_t triangle, const ProxyWindow&) const;
  Eigen::Vector3d normalNear(const Surroundings&, Scratch&) const;
  bool isInCone(std::uint32_t triangle, const Eigen::Vector3d& normal) const;
  bool findHeights(const Surroundings&, const ProxyWindow&, double& low, double& high,
                   Scratch&) const;
  bool isNearestInside(const Surroundings&, const ProxyWindow&, double middle, double& error,
                       Scratch&) const;
  bool isFarEnough(const Shadow&, const ProxyWindow&, double middle, double error) const;

  const MeshTopology& m_topology;
  const std::span<const Eigen::Vector3d> m_positions;
  const double m_allowedError, m_cosine, m_rounding;
  CountedVector<Eigen::Vector3d> m_normals;  ///< per triangle, with twice its area as length
};

}  // namespace palpate
