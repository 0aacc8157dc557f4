#pragma once

#include <palpate/CollisionData.h>

#include "Core/Buffer.h"
#include "DistanceField/SurfaceProxy.h"
#include "Mesh/TriangleMesh.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate {

/// The contacts of a range of particles, in ascending order, and scratch.
struct ProxyHits {
  struct Hit {
    std::uint32_t point;
    /// A leaf with a plane; or the index of a normal, marked with kListed, if triangles answered.
    std::uint32_t source;
    double distance;  ///< L, from the particle's centre; negative behind the plane
  };
  static constexpr std::uint32_t kListed = 0x80000000u;

  Buffer<Hit> hits;
  std::size_t count = 0;            ///< of hits; the buffer may be larger
  Buffer<Eigen::Vector3d> normals;  ///< in the body's frame
  Buffer<Eigen::Vector3d> world;    ///< scratch: placed particles
  double error = 0;                 ///< L: of all leaves that answered
  std::size_t answered = 0;         ///< particles in leaves that are not far from the surface
};

/// From the world to the cells of a proxy.
struct ProxyMap {
  std::array<std::array<double, 3>, 3> rotation;  ///< rows: from the world to the body
  std::array<double, 3> translation;              ///< of the body
  std::array<double, 3> lower;                    ///< of the cells
  double perLength, units;                        ///< units per L, and along each axis
  std::int32_t bricks;                            ///< along each axis
};

/// A proxy where its body is now, for one pair and frame.
class PlacedProxy {
 public:
  /// thickness: L. The body's positions must be those that the proxy was made from.
  PlacedProxy(const SurfaceProxy&, const TriangleMesh& body, double thickness);

  /// Finds the particles within the thickness and their radii, of those in [begin, end).
  /// byBruteForce: finds each particle's leaf among all leaves.
  void find(const TriangleMesh& points, std::size_t begin, std::size_t end, bool byBruteForce,
            ProxyHits& out) const;
  /// Writes a contact for each hit.
  void write(const TriangleMesh& points, const ProxyHits&, ShapeContact* out) const;

  /// L: CollisionData::errorBound(), where `error` is that of the leaves that answered.
  double totalError(double error) const;

 private:
  struct Block;
  void locate(const Eigen::Vector3d* points, std::size_t size, Block&) const;
  void findLeaves(std::size_t size, bool byBruteForce, Block&) const;
  void findAmong(const SurfaceProxy::Leaf&, const Eigen::Vector3d& p, std::uint32_t point,
                 double limit, ProxyHits& out) const;
  bool isInFront(std::uint32_t triangle, TriangleFeature, const Eigen::Vector3d& difference) const;

  const SurfaceProxy* m_proxy;
  const TriangleMesh* m_body;
  double m_thickness;    ///< L
  bool m_outerSideOnly;  ///< of a mesh that is not closed
  ProxyMap m_map;
  std::array<std::array<double, 3>, 3> m_turn;  ///< rows: turns normals to the world
  double m_stretch = 0;      ///< by how much at most the placement changes lengths
  double m_translation = 0;  ///< L: its largest coordinate
};

}  // namespace palpate
