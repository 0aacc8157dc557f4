#pragma once

#include "Core/Buffer.h"
#include "Core/Threads.h"
#include "Math/SolidAngle.h"
#include "Mesh/Revision.h"
#include "Octree/PointQueries.h"

#include <Eigen/Core>

#include <cstdint>

namespace palpate {

struct SearchableGeometry;

/// The generalised winding number of any triangles about points: the sum of the shares of all
/// directions that they take, each by its side. Of a closed body it is the winding number.
///
/// Source   Jacobson, Kavan, Sorkine-Hornung (2013); Barill, Dickson, Schmidt, Levin, Jacobson: Fast
///          winding numbers for soups and clouds (2018). Difference: of what is far the error is
///          bounded, 3 A r² / 4 pi (d - r)^4 for triangles of area A within r of a centre at the
///          distance d, which is what the third derivatives of 1 / d leave of the first two
///          moments; near ones are summed; and where the bounds do not decide, further ones are, at
///          last all.
class WindingNumbers {
 public:
  struct Answer {
    bool inside;   ///< or not decided
    bool decided;  ///< which all bounds agree on
  };

  /// Brings the clusters to the body's positions now, which its octree must be of.
  void update(const SearchableGeometry& body, const Threads&);
  /// After update(). Whether the number's magnitude is at least 1/2; not decided within the margin
  /// of that, and what rounding leaves open. As by the sum of all, whatever the octree.
  Answer ask(const SearchableGeometry& body, const Eigen::Vector3d&, double margin, bool bruteForce,
             PointQueryStack&) const;

 private:
  /// Triangles far away: seen from their centre of mass.
  struct Cluster {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();  ///< integral of (x - centre) normal^T
    double area = 0, radius = 0;
    void add(const Cluster&);
    void reach(const Cluster&);
  };
  void addOwn(const SearchableGeometry& body, OctreeNode);
  SeenShare share(const Cluster&, const Eigen::Vector3d& p, double distance) const;

  DerivedFrom<2> m_clustersOf;      ///< positions in the body's frame, and the transform
  std::uint64_t m_treeUpdates = 0;  ///< GeometryOctree::updates() then
  Buffer<Cluster> m_clusters;       ///< by octree node
  double m_magnitude = 0;           ///< L: of the coordinates
};

}  // namespace palpate
