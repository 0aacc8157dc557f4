#pragma once

#include <palpate/Export.h>
#include <palpate/SpatialQueries.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstdint>
#include <span>

namespace palpate {

/// The geometries of an OctreeBasedCD as they were when publish() was called: their positions,
/// transforms and octrees, and their motion in the step. A snapshot never changes. Other threads
/// query it while the simulation computes the next steps. Docs/HowTo/Haptics.md has an example.
/// Valid    as long as a shared_ptr holds it, also after the OctreeBasedCD was destroyed. Spans are
///          valid as long.
/// Threads  all functions are safe from any number of threads. Batches run on the calling thread.
/// Errors   functions that take a GeometryId throw UnknownGeometry for a geometry that the
///          OctreeBasedCD did not have at publish().
class PALPATE_EXPORT Snapshot {
 public:
  /// Queries at the positions now of publish(). A copy of the object throws InvalidCall after the
  /// snapshot was released.
  /// Waiting  only threads that query snapshots wait for each other: for a moment to take scratch,
  ///          and while one of them prepares a geometry for the first contains(), signedDistance(),
  ///          findInsideVertices(), findEmbeddedVertices() or findTetrahedron().
  const SpatialQueries& queries() const;
  std::uint64_t number() const;  ///< counts the publications of the OctreeBasedCD, from 1
  double time() const;           ///< as passed to publish()

  bool has(GeometryId) const;  ///< whether the snapshot has the geometry; any id is valid
  /// L: the positions at the end and at the start of the step. As in OctreeBasedCD::positions(),
  /// they are in the body's frame, and empty for a shape. motion() brings them into the world.
  std::span<const Eigen::Vector3d> positions(GeometryId) const;
  std::span<const Eigen::Vector3d> positionsBefore(GeometryId) const;
  /// The poses at both ends of the step, as setTransform() set them.
  RigidMotion motion(GeometryId) const;
  /// L, in the world: where a vertex is on the straight line of its step. time: 0 for the start of
  /// the step, 1 for its end; other times extrapolate.
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
