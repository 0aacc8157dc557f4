#pragma once

#include <palpate/OctreeBasedCD.h>

#include <memory>
#include <span>

namespace palpate {

/// Collision detection by FCL, with functions of OctreeBasedCD, to compare both or to change
/// between them. FCL decides in floating point, within tolerances that do not scale with the
/// bodies. The promises of OctreeBasedCD do not hold here (Docs/Fcl.md), and validity() is never
/// trusted.
///
/// Pairs    two triangle meshes by Method::Intersection, with intersectingTriangles() and no
///          contacts; two shapes by Method::Proximity, with shapeShape(). The thickness must be 0
///          unless FCL has a closed form of the distance: for a sphere with a sphere, capsule, box
///          or cylinder, and for two capsules.
/// Errors   as in OctreeBasedCD, which keeps and checks the data: every function that takes data
///          throws palpate::Error and changes nothing. addCollisionPair() throws UnsupportedMethod
///          for all other pairs and methods. detectCollision() throws NotAvailable if FCL throws.
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

  /// Tests every pair at the positions now. If it throws, the last answers stay readable.
  void detectCollision();
  /// The answer of the last detectCollision(), with the errors of OctreeBasedCD. For shapes that
  /// overlap the normal is FCL's. For shapes that are apart it points along FCL's two nearest
  /// points; it is 0 if these are the same.
  const CollisionData& collisionData(GeometryId a, GeometryId b) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
