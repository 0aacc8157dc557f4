#pragma once

#include <palpate/OctreeBasedCD.h>

#include <memory>
#include <span>

namespace palpate {

/// Collision detection by FCL, with the functions of OctreeBasedCD that have a meaning there: to
/// switch and to compare. FCL decides in floating point, within tolerances that do not scale with
/// the bodies: nothing that OctreeBasedCD promises is promised here (Docs/Fcl.md), and validity()
/// never trusts.
///
/// Pairs    triangle meshes by Method::Intersection: intersectingTriangles(), no contacts. Two
/// shapes by
///          Method::Proximity: shapeShape(). A plane has no distance in FCL, only overlaps:
///          thickness 0.
/// Errors   as OctreeBasedCD's, which keeps and checks what is handed in: every function that takes
///          data throws palpate::Error and changes nothing. All other pairs and methods:
///          UnsupportedMethod. Where FCL itself gives up, detectCollision() throws NotAvailable.
/// Threads  none of its own.
class PALPATE_EXPORT FclEngine {
 public:
  FclEngine();
  FclEngine(FclEngine&&) noexcept;
  FclEngine& operator=(FclEngine&&) noexcept;
  ~FclEngine();

  GeometryId addTriangleMesh(std::span<const Eigen::Vector3d> positions,
                             std::span<const Triangle> triangles);
  GeometryId addAnalyticalGeometry(const AnalyticalGeometry&);
  void removeGeometry(GeometryId);  ///< and its pairs

  void setPositions(GeometryId, std::span<const Eigen::Vector3d> now);
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>);
  void setTransform(GeometryId, const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& translation);

  void addCollisionPair(GeometryId a, GeometryId b, const PairSettings& = {});
  void removeCollisionPair(GeometryId a, GeometryId b);
  std::span<const CollisionPair> pairs() const;

  void detectCollision();
  /// Normals are FCL's, or lead from its one nearest point to the other, and are zero where these
  /// are one.
  const CollisionData& collisionData(GeometryId a, GeometryId b) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
