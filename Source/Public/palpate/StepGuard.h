#pragma once

#include <palpate/Error.h>
#include <palpate/Export.h>
#include <palpate/Settings.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace palpate {

/// The step of one geometry. Each vertex moves in a straight line from `before` to `now`.
struct GuardedStep {
  GeometryId geometry;
  std::span<const Eigen::Vector3d> before;  ///< L, one for each vertex
  std::span<Eigen::Vector3d> now;           ///< L, one for each vertex; hold() changes it
};

/// A vertex of a geometry of a StepGuard.
struct GuardedVertex {
  GeometryId geometry;
  std::uint32_t vertex;
  friend bool operator==(const GuardedVertex&, const GuardedVertex&) = default;
  friend auto operator<=>(const GuardedVertex&, const GuardedVertex&) = default;
};

/// Keeps geometries from passing through each other at the end of a solver's step. Constraints are
/// met one after another, so a solver may leave an impact in its step. hold() moves vertices of
/// features that touch within the step from `now` back to `before`, until no features touch.
///
///   StepGuard guard;
///   const GeometryId organ = guard.addTriangleMesh(positions, triangles);
///   const GeometryId thread = guard.addLineMesh(line, segments);
///   guard.addPair(organ, thread);
///   guard.addPair(thread, thread);
///   // after the solver's last correction of a step:
///   const std::array steps{GuardedStep{organ, before, now},
///                          GuardedStep{thread, lineBefore, lineNow}};
///   guard.hold(steps);
///
/// Features  a vertex and a triangle, or two edges, as of Method::Continuous without a thickness;
///           of a geometry with itself those without a common vertex. Radii are not asked: lines
///           are their centre lines, and points are their centres. What touches at the first or the
///           last moment of the step touches.
/// Laws      (1) after hold() no features of the given pairs touch within the step. This is decided
///           exactly on the given doubles.
///           (2) after hold() each vertex is exactly at `before` or exactly at the `now` that the
///           solver gave.
///           (3) a step that hold() ended starts the next one without a touch, if the next `before`
///           is this `now`.
///           (4) hold() needs at most one round more than it holds vertices: each round but the
///           last moves at least one vertex back, and no vertex moves back twice.
/// Limits    surfaces that already cross at `before` are not parted: only features that touch
///           count. Intersection at the start is for Method::Intersection and
///           Validity::startedApart. Analytical geometries and transforms are not guarded: give a
///           tool as a mesh, with its vertices at both ends of the step.
/// Cost      each round is one detection by Method::Continuous of the pairs whose positions changed
///           since the round before, with octrees of the guard's own. A geometry that is not
///           given costs nothing. Steady steps allocate nothing.
/// Order     results do not depend on the number of threads, nor on the order of the steps.
/// Errors    every function throws palpate::Error where its data are wrong, and then changes
///           nothing: neither the guard nor the caller's positions. After a move everything but
///           assignment and destruction throws InvalidCall.
/// Threads   an object is used from one thread at a time. Two objects share nothing.
class PALPATE_EXPORT StepGuard {
 public:
  /// settings: of the detections; both engines hold the same vertices.
  explicit StepGuard(const Settings& = {});
  StepGuard(StepGuard&&) noexcept;
  StepGuard& operator=(StepGuard&&) noexcept;
  ~StepGuard();

  // Ids are the guard's own. Data are checked as by the functions of OctreeBasedCD of these names.
  GeometryId addTriangleMesh(std::span<const Eigen::Vector3d> positions, std::span<const Triangle>);
  /// Its surface is guarded: a vertex that is on no face of the surface never moves back.
  GeometryId addTetrahedralMesh(std::span<const Eigen::Vector3d> positions,
                                std::span<const Tetrahedron>);
  GeometryId addLineMesh(std::span<const Eigen::Vector3d> positions, std::span<const Segment>);
  GeometryId addPointSet(std::span<const Eigen::Vector3d> positions);
  /// New topology, as after a cut. The vertices that stay keep their groups and stay fixed;
  /// vertices that are new are free.
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>);
  void setTetrahedra(GeometryId, std::span<const Eigen::Vector3d> positions,
                     std::span<const Tetrahedron>);
  void removeGeometry(GeometryId);  ///< and its pairs

  /// These never pass through each other. a == b: the geometry does not pass through itself.
  void addPair(GeometryId a, GeometryId b);
  void removePair(GeometryId a, GeometryId b);
  /// Triangles, segments or points that may be passed through, as where a needle pierced; all
  /// others are on. A vertex or edge is on while an element that holds it is.
  void setDisabledElements(GeometryId, std::span<const std::uint32_t> elements);

  /// These vertices move back together: all, or none. Groups with a common vertex become one.
  void addRigidGroup(std::span<const GuardedVertex>);
  /// All vertices of a geometry.
  void addRigidGroup(GeometryId);
  /// These vertices never move back, as those of a tool that nothing holds; all others may. A group
  /// with a fixed vertex never moves back.
  void setFixedVertices(GeometryId, std::span<const std::uint32_t> vertices);

  /// Moves vertices in the given `now` back to their `before`, until no features touch within the
  /// step. All vertices of features that touch move back, with their groups, but fixed ones.
  /// A geometry that is not given is at rest where the last successful hold() left it, or where it
  /// was added or given a topology.
  ///
  /// Returns  the number of vertices that moved back; vertices at rest do not count.
  /// Errors   ImpactRemains names the geometries and features that touch and cannot be parted:
  ///          they touched before the step, or all their vertices that move are fixed.
  ///          UnknownGeometry, WrongPositionCount and NonFinitePosition as setPositions() of
  ///          OctreeBasedCD; InvalidSettings for a geometry that is given twice.
  std::size_t hold(std::span<const GuardedStep> steps);

  /// The vertices that the last successful hold() moved back, ascending. The span lives until the
  /// next hold().
  std::span<const GuardedVertex> held() const;
  std::size_t rounds() const;  ///< detections of the last successful hold()

 private:
  struct Implementation;
  Implementation& all() const;  ///< throws InvalidCall
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
