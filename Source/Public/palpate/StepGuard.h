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

/// The step of one geometry, for StepGuard::hold(). Each vertex moves in a straight line from
/// `before` to `now`.
struct GuardedStep {
  GeometryId geometry;
  std::span<const Eigen::Vector3d> before;  ///< L, one for each vertex
  std::span<Eigen::Vector3d> now;           ///< L, one for each vertex; hold() may change it
};

/// A vertex of one of the geometries of a StepGuard.
struct GuardedVertex {
  GeometryId geometry;
  std::uint32_t vertex;
  friend bool operator==(const GuardedVertex&, const GuardedVertex&) = default;
  friend auto operator<=>(const GuardedVertex&, const GuardedVertex&) = default;
};

/// Prevents geometries from passing through each other at the end of a solver's step. A solver
/// meets constraints one after another, so that an impact may remain in its step. The function
/// hold() finds features that touch within the step. It moves their vertices from `now` back to
/// `before`, until no features touch.
///
///   StepGuard guard;
///   const GeometryId organ = guard.addTriangleMesh(positions, triangles);
///   const GeometryId thread = guard.addLineMesh(line, segments);
///   guard.addCollisionPair(organ, thread);
///   guard.addCollisionPair(thread, thread);
///   // after the solver's last correction of a step:
///   const std::array steps{GuardedStep{organ, before, now},
///                          GuardedStep{thread, lineBefore, lineNow}};
///   guard.hold(steps);
///
/// Features  a vertex and a triangle, or two edges, as in Method::Continuous without a thickness;
///           for a geometry with itself those without a common vertex. Radii have no effect: lines
///           are their centre lines, points are their centres. The surfaces of lines and points may
///           therefore overlap after hold(), by less than the sum of their radii. Features that
///           touch only at the first or the last moment of the step touch.
/// Laws      (1) after hold() no features of the given pairs touch within the step. This is decided
///           exactly on the given doubles.
///           (2) after hold() each vertex is exactly at `before` or exactly at the `now` that the
///           solver gave.
///           (3) if the next `before` is this `now`, the next step starts without a touch.
///           (4) if hold() moves n vertices back, it needs at most n + 1 rounds: each round except
///           the last moves at least one vertex back, and no vertex moves back twice.
/// Limits    surfaces that cross already at `before` stay as they are: only features that touch
///           count. Method::Intersection and Validity::startedApart find such surfaces. Analytical
///           geometries and transforms are not guarded: add a tool as a mesh, with its vertices at
///           both ends of the step.
/// Cost      each round is one detection by Method::Continuous of the pairs whose positions changed
///           since the round before, with octrees that belong to the guard. A geometry that you do
///           not pass to hold() costs nothing. Steady steps allocate nothing, except for integers
///           of exact arithmetic (Docs/Guarantees.md, "Memory").
/// Order     results depend neither on the number of threads nor on the order of the steps.
/// Errors    every function throws palpate::Error for invalid data, and then changes neither the
///           guard nor the caller's positions. Every function that takes a GeometryId throws
///           UnknownGeometry. After a move every function except assignment and destruction throws
///           InvalidCall.
/// Threads   use an object from one thread at a time. Two objects share nothing but an executor.
class PALPATE_EXPORT StepGuard {
 public:
  /// settings: those of the detections; held vertices do not depend on them.
  /// Errors   InvalidSettings.
  explicit StepGuard(const Settings& = {});
  StepGuard(StepGuard&&) noexcept;
  StepGuard& operator=(StepGuard&&) noexcept;
  ~StepGuard();

  // These functions add geometries to the guard, which has ids of its own. Their parameters and
  // errors are those of the functions of OctreeBasedCD with these names.

  GeometryId addTriangleMesh(std::span<const Eigen::Vector3d> positions, std::span<const Triangle>);
  /// The guard holds the surface. A vertex that belongs to no face of the surface never moves back
  /// on its own.
  GeometryId addTetrahedralMesh(std::span<const Eigen::Vector3d> positions,
                                std::span<const Tetrahedron>);
  GeometryId addLineMesh(std::span<const Eigen::Vector3d> positions, std::span<const Segment>);
  GeometryId addPointSet(std::span<const Eigen::Vector3d> positions);
  /// These set a new topology, as after a cut, with the errors of OctreeBasedCD. Vertices that stay
  /// keep their groups and stay fixed; new vertices are free.
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>);
  void setTetrahedra(GeometryId, std::span<const Eigen::Vector3d> positions,
                     std::span<const Tetrahedron>);
  /// Removes a geometry and its pairs.
  void removeGeometry(GeometryId);

  /// The two geometries must not pass through each other. a == b: the geometry must not pass
  /// through itself.
  ///
  /// Errors   DuplicatePair.
  void addCollisionPair(GeometryId a, GeometryId b);
  void removeCollisionPair(GeometryId a, GeometryId b);  ///< in either order; throws UnknownPair
  /// Disables these triangles, segments or points and enables all others. Other geometries may pass
  /// through disabled elements, as where a needle pierced. A vertex or edge is enabled while an
  /// enabled element holds it.
  ///
  /// Errors   IndexOutOfRange.
  void setDisabledElements(GeometryId, std::span<const std::uint32_t> elements);

  /// These vertices move back together: all or none. Groups with a common vertex become one group.
  ///
  /// Errors   IndexOutOfRange.
  void addRigidGroup(std::span<const GuardedVertex>);
  /// The same for all vertices of a geometry.
  void addRigidGroup(GeometryId);
  /// These vertices of a geometry never move back, and all its other vertices may. Use it for a
  /// tool that nothing holds. A group with a fixed vertex never moves back. If hold() throws
  /// ImpactRemains, set the `now` of these vertices to `before` and call it again. Vertices that a
  /// hand drives need not be fixed: hold() may then move them back, and the hand has to wait.
  ///
  /// Errors   IndexOutOfRange.
  void setFixedVertices(GeometryId, std::span<const std::uint32_t> vertices);

  /// Moves vertices in the given `now` back to their `before`, until no features touch within the
  /// step. If features touch, all their vertices move back with their groups, except fixed ones. A
  /// geometry without a step in `steps` is at rest, where the last successful hold() left it or
  /// where it was added or received a topology. hold() changes your positions only: set them again
  /// in the OctreeBasedCD before advance().
  ///
  /// Returns  the number of vertices that moved back; vertices at rest do not count.
  /// Errors   ImpactRemains if features touch and cannot move back: they touched before the step,
  ///          or all their vertices that move are fixed. The message names geometries and features.
  ///          UnknownGeometry, WrongPositionCount and NonFinitePosition as in setPositions() of
  ///          OctreeBasedCD; InvalidSettings if a geometry has two steps.
  std::size_t hold(std::span<const GuardedStep> steps);

  /// The vertices that the last successful hold() moved back, ascending. The span is valid until
  /// the next hold().
  std::span<const GuardedVertex> held() const;
  std::size_t rounds() const;  ///< number of detections in the last successful hold()

 private:
  struct Implementation;
  Implementation& all() const;  ///< throws InvalidCall
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
