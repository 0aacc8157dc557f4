#pragma once

#include <palpate/CollisionData.h>

#include "DistanceField/SurfaceProxy.h"
#include "Mesh/Motion.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"

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
  Buffer<std::uint32_t> others;     ///< particles that may have an impact in the step
};

/// A step, for a proxy that answers particles without an impact.
struct ProxyStep {
  MotionRange body;   ///< of the body's vertices
  double thickness;   ///< L: that of the pair
  double slowMotion;  ///< L: particles that move further are answered only if they stay far away
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
  /// step: null, or particles that may have an impact in it are listed and no hits. A particle has
  /// none if its distance at the end, less the error, exceeds its motion relative to the body and
  /// its radius. A fast one must in addition be apart by the thickness.
  void find(const TriangleMesh& points, std::size_t begin, std::size_t end, bool byBruteForce,
            const ProxyStep* step, ProxyHits& out) const;
  /// Writes a contact for each hit.
  void write(const TriangleMesh& points, const ProxyHits&, ShapeContact* out) const;

  /// L: CollisionData::errorBound(), where `error` is that of the leaves that answered.
  double totalError(double error) const;
  double depth() const { return m_proxy->depth(); }  ///< L: Validity::proxyDepth

 private:
  struct Block;
  void locate(const Eigen::Vector3d* points, std::size_t size, Block&) const;
  void findLeaves(std::size_t size, bool byBruteForce, Block&) const;
  void addHits(const TriangleMesh& points, std::uint32_t first, std::size_t size, const Block&,
               const ProxyStep*, ProxyHits&) const;
  struct Nearest {
    Eigen::Vector3d normal;  ///< in the body's frame
    double distance;         ///< L, signed where sides count
    bool isHidden;           ///< by Sidedness::Outer
  };
  Nearest nearestAmong(const SurfaceProxy::Leaf&, const Eigen::Vector3d& p) const;
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
