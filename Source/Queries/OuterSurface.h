#pragma once

#include "Queries/PointDistances.h"
#include "Queries/SearchableGeometry.h"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <optional>

namespace palpate {

/// The outer surface of a closed body: the points of its surface beside which the winding number
/// is 0. Where parts of the body overlap, the surface of one is inside another, and leads nowhere.
class OuterSurface {
 public:
  /// L, in the world: the winding number of the body about a point; none on its surface.
  using WindingNumber = std::function<std::optional<int>(const Eigen::Vector3d&)>;

  OuterSurface(const SearchableGeometry&, bool bruteForce, WindingNumber);

  /// Whether the surface point that is nearest to p is on the outer surface. number: the winding
  /// number about p, not 0.
  bool holds(const Eigen::Vector3d& p, const PointDistances&, const PointDistances::Near&,
             int number) const;

  struct Near {
    std::uint32_t element;
    Eigen::Vector3d point;  ///< L, in the world
  };
  /// The point of the outer surface that is nearest to p: on a face or an edge of a triangle, or
  /// where two triangles intersect. Where three triangles have one common point inside all of them,
  /// it may be another one that is further away. nearest: L, the distance of the surface.
  ///
  /// Cost     quadratic in the triangles up to twice as far away as the result.
  std::optional<Near> nearest(const Eigen::Vector3d& p, double nearest) const;

 private:
  struct Candidates;
  bool holdsPoint(const Eigen::Vector3d& q, const Eigen::Vector3d& from, const Candidates&) const;
  double aside(const Eigen::Vector3d& p) const;

  const SearchableGeometry& m_geometry;
  const bool m_bruteForce;
  const WindingNumber m_windingNumber;
};

}  // namespace palpate
