#pragma once

#include <palpate/AnalyticalGeometry.h>
#include <palpate/Capture.h>

#include "CollisionDetection/Geometry.h"

#include <memory>
#include <span>

namespace palpate {

/// Makes a geometry of what the user gives, at rest. Each function throws an Error that describes
/// what is wrong with its arguments.
class GeometryBuilder {
 public:
  /// revisions: where the numbers of the geometry's revisions begin.
  GeometryBuilder(GeometryId id, Revision::Counter revisions) : m_id(id), m_revisions(revisions) {}
  GeometryId id() const { return m_id; }

  using Built = std::unique_ptr<Geometry>;
  /// radii: none, one for all, or as many as positions.
  Built triangles(std::span<const Eigen::Vector3d> positions, std::span<const Triangle>,
                  GeometryType = GeometryType::Triangles, std::span<const double> radii = {}) const;
  Built lines(std::span<const Eigen::Vector3d> positions, std::span<const Segment>,
              std::span<const double> radii) const;
  Built points(std::span<const Eigen::Vector3d> positions, std::span<const double> radii) const;
  Built tetrahedra(std::span<const Eigen::Vector3d> positions, std::span<const Tetrahedron>) const;
  Built shape(const AnalyticalGeometry&) const;
  Built field(std::shared_ptr<const DistanceField>) const;
  /// At rest at its positions, without what is attached. Of a tetrahedral mesh after cuts,
  /// `triangles` is the surface.
  Built problem(const CollisionProblem::Geometry&) const;

 private:
  Built build(RestShape) const;
  Built afterCuts(const CollisionProblem::Geometry&,
                  std::span<const Eigen::Vector3d> positions) const;

  GeometryId m_id;
  Revision::Counter m_revisions;
};

}  // namespace palpate
