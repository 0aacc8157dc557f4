#pragma once

#include "DistanceField/BoundaryCurve.h"
#include "Bodies/Body.h"
#include "Octree/PointQueries.h"

#include <Eigen/Core>

#include <optional>

namespace palpate {

/// Whether points are inside a mesh, and where the answer is reliable.
///
/// Inside is where the magnitude of the generalised winding number is more than 1/2. Of a closed,
/// consistently oriented mesh the winding number is an integer, and the answer is exact.
///
/// Reliable: the winding number is within 3/8 of an integer. Where all points of a convex set are
/// reliable, the sign changes in it at triangles only.
class SurfaceSign {
 public:
  enum class Reliability {
    Reliable,  ///< certainly in all points
    Unknown,
    Unreliable  ///< certainly in all points
  };

  /// body: its octree must be up to date, and its windingNumbers unless it is closed.
  SurfaceSign(const Body& body, bool isClosed);

  bool isClosed() const { return m_isClosed; }
  bool isInside(const Eigen::Vector3d&, PointQueryStack&) const;
  /// Of the points of a ball.
  Reliability in(const Eigen::Vector3d& centre, double radius) const;
  /// L: all points further than this from a convex set around the mesh are reliable, and outside.
  double reach() const;

 private:
  const Body& m_body;
  const bool m_isClosed;
  std::optional<BoundaryCurve> m_boundary;  ///< unless closed
};

}  // namespace palpate
