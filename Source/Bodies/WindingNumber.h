#pragma once

#include "Octree/PointQueries.h"
#include "Mesh/Revision.h"
#include "Math/SolidAngle.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <optional>

namespace palpate {

struct Body;

/// The generalised winding number of any triangles about points: the sum of their solid angles, as
/// shares of the sphere, signed by the side that faces the point. For a closed body it is the
/// winding number.
///
/// Source   Jacobson, Kavan, Sorkine-Hornung (2013); Barill, Dickson, Schmidt, Levin, Jacobson: Fast
///          winding numbers for soups and clouds (2018). Difference: the error of far triangles is
///          bounded. For triangles of total area A within r of a centre at the distance d it is at
///          most 3 A r² / 4 pi (d - r)^4: the remainder after the first two moments, from the third
///          derivatives of 1 / d. The cluster with the largest bound is divided until the sum of
///          the bounds decides; its triangles are summed one by one. In the end all are.
class WindingNumbers {
 public:
  struct Result {
    bool inside;   ///< also true if not decided
    bool decided;  ///< the error bounds leave no doubt
  };

  /// Updates the clusters to the body's positions now. The body's octree must be up to date.
  void update(const Body& body, const Threads&);
  /// Call after update(). Returns whether the winding number's magnitude is at least 1/2. Not
  /// decided if it is within `margin` of 1/2, or if rounding errors leave this open. The answer is
  /// that of the sum over all triangles, and does not depend on the octree.
  Result evaluate(const Body& body, const Eigen::Vector3d&, double margin, bool bruteForce) const;
  /// Call after update(). The winding number, which may have either sign, with an error bound. The
  /// bound is at most `error`, unless rounding errors are larger.
  SolidAngleShare value(const Body& body, const Eigen::Vector3d&, double error) const;

 private:
  /// Moments of a set of triangles about their centre of mass, for points far away.
  struct Cluster {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();  ///< integral of (x - centre) normal^T
    double area = 0, radius = 0;
    void add(const Cluster&);
    void enclose(const Cluster&);
  };
  void computeOwnCluster(const Body& body, OctreeNode);
  SolidAngleShare clusterShare(const Cluster&, const Eigen::Vector3d& p, double distance) const;
  /// Most clusters that are weighed against each other. Where more would be needed, all triangles
  /// are summed. Points in and around a body of 100,352 triangles need up to 1,000. 488 places are
  /// for the children of a cluster that is divided.
  static constexpr std::size_t kMostClusters = 4096;
  struct Front;
  /// The sum of clusters and triangles for which isEnough(sum) is true, if there is one.
  template <class F>
  std::optional<SolidAngleShare> sumOfClusters(const Body& body, const Eigen::Vector3d&,
                                               F&& isEnough) const;
  /// The sum of clusters and triangles for which isEnough(sum) is true, or else that of all
  /// triangles.
  template <class F>
  SolidAngleShare sum(const Body& body, const Eigen::Vector3d&, bool bruteForce,
                      F&& isEnough) const;

  DerivedFrom<PositionsState> m_clustersVersion;
  std::uint64_t m_treeUpdates = 0;  ///< GeometryOctree::updates() for which m_clusters hold
  Buffer<Cluster> m_clusters;       ///< by octree node
  double m_magnitude = 0;           ///< L: of the coordinates
};

}  // namespace palpate
