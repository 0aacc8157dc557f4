#pragma once

#include <palpate/Export.h>
#include <palpate/SpatialQueries.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstdint>
#include <span>

namespace palpate {

/// The positions, transforms, octrees and motion at publish(). It never changes.
/// Valid    with its spans as long as a shared_ptr holds it, also after the OctreeBasedCD.
/// Threads  all functions are safe from any number of threads. Batches run on the calling thread.
/// Errors   UnknownGeometry for a geometry that the OctreeBasedCD did not have at publish().
class PALPATE_EXPORT Snapshot {
 public:
  /// Queries at the positions now of publish(). A copy throws InvalidCall after the snapshot was
  /// released. Threads wait only for each other: for scratch, and while one prepares a geometry.
  const SpatialQueries& queries() const;
  std::uint64_t number() const;  ///< counts the publications of the OctreeBasedCD, from 1
  double time() const;           ///< as passed to publish()

  bool has(GeometryId) const;  ///< whether the snapshot has the geometry; any id is valid
  /// L, as OctreeBasedCD::positions(), at the end and at the start of the step.
  std::span<const Eigen::Vector3d> positions(GeometryId) const;
  std::span<const Eigen::Vector3d> positionsBefore(GeometryId) const;
  RigidMotion motion(GeometryId) const;                   ///< at both ends of the step
  std::span<const std::uint32_t> tags(GeometryId) const;  ///< OctreeBasedCD::tags()
  /// L, in the world, on the step's line at `time`: 0 start, 1 end, others extrapolate.
  /// Errors   IndexOutOfRange; InvalidSettings for a time that is not finite.
  Eigen::Vector3d position(GeometryId, std::uint32_t vertex, double time = 1.0) const;

  class Contents;  ///< not part of the interface
  Snapshot(const Snapshot&) = delete;
  Snapshot& operator=(const Snapshot&) = delete;

 private:
  explicit Snapshot(const Contents& contents) : m_contents(contents) {}

  const Contents& m_contents;
};

}  // namespace palpate
