#pragma once

#include "Queries/VertexSearch.h"
#include "Bodies/Body.h"
#include "Octree/PointQueries.h"
#include "Math/TriangleIntersection.h"

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <vector>

namespace palpate {

/// Decides how triangles lie to the surface of a closed mesh. Docs/Simplification.md has the
/// theorems and their proofs.
class SimplifyCertificate {
 public:
  /// largest: L, of all coordinates of triangles and mesh. The geometry's octree must be up to
  /// date.
  SimplifyCertificate(const Body&, double maxDistance, double largest);

  /// Writes the triangles of the mesh with which this one has a point in common, by their places in
  /// the octree's order. Decided exactly.
  void findTouched(const Corners&, PointQueryStack&, std::vector<std::uint32_t>& places) const;
  /// Whether there are any.
  bool touches(const Corners&, PointQueryStack&) const;
  bool isInside(const Eigen::Vector3d&, PointQueryStack&) const;
  /// A bound on the distance of all points of the triangle from the mesh's surface, at most the
  /// maxDistance; none if there is no proof. The triangle must not touch the mesh, and not be
  /// inside it.
  std::optional<double> distanceBound(const Corners&, PointQueryStack&) const;

 private:
  struct Foot {
    Eigen::Vector3d position;
    double distance;  ///< L, at least that of the corner
    std::uint32_t place;
  };
  template <class F>
  void forEachTouched(const Corners&, PointQueryStack&, F&&) const;
  Foot footOf(const Eigen::Vector3d&, std::uint32_t likely) const;
  std::optional<double> boundBelow(const Corners&, const Corners& below, PointQueryStack&) const;
  std::optional<double> boundOf(const Corners&, const std::array<Foot, 3>&, PointQueryStack&) const;
  std::optional<double> bound(const Corners&, const std::array<Foot, 3>&, int depth,
                              PointQueryStack&) const;

  const Body& m_geometry;
  const PointFrame m_frame;
  double m_maxDistance, m_slack;  ///< L
};

}  // namespace palpate
