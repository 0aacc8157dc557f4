#pragma once

#include <palpate/OctreeBasedCD.h>

#include <memory>
#include <span>

namespace palpate {

/// FCL behind functions of OctreeBasedCD. It decides in floating point, within absolute tolerances:
/// the promises of OctreeBasedCD do not hold (Docs/Fcl.md), and validity() is never trusted.
/// Pairs    two triangle meshes by Method::Intersection, with intersectingTriangles() and no
///          contacts; two shapes by Method::Proximity. The thickness must be 0 except for a sphere
///          with a sphere, capsule, box or cylinder, and for two capsules.
/// Errors   those of OctreeBasedCD. addCollisionPair() throws UnsupportedMethod for others,
///          detectCollision() NotAvailable if FCL throws.
/// Threads  it starts none. Use an object from one thread at a time.
class PALPATE_EXPORT FclEngine {
 public:
  FclEngine();
  FclEngine(FclEngine&&) noexcept;
  FclEngine& operator=(FclEngine&&) noexcept;
  ~FclEngine();

  GeometryId addTriangleMesh(std::span<const Eigen::Vector3d> positions,
                             std::span<const Triangle> triangles);
  GeometryId addAnalyticalGeometry(const AnalyticalGeometry&);
  void removeGeometry(GeometryId);  ///< removes its pairs, too

  void setPositions(GeometryId, std::span<const Eigen::Vector3d> now);
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>);
  void setTransform(GeometryId, const Pose&);

  void addCollisionPair(GeometryId a, GeometryId b, const PairSettings& = {});
  void removeCollisionPair(GeometryId a, GeometryId b);
  std::span<const CollisionPair> pairs() const;

  void detectCollision();  ///< at the positions now; the last answers stay if it throws
  /// Of shapes that overlap the normal is FCL's; else along its nearest points, or 0.
  const CollisionData& collisionData(GeometryId a, GeometryId b) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
