#pragma once

#include <palpate/Error.h>
#include <palpate/Export.h>
#include <palpate/Types.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace palpate {

class OctreeBasedCD;

/// A vertex of a geometry of an OctreeBasedCD. kNoElement: the whole geometry.
struct GuardedVertex {
  GeometryId geometry;
  std::uint32_t vertex = kNoElement;
  friend bool operator==(const GuardedVertex&, const GuardedVertex&) = default;
  friend auto operator<=>(const GuardedVertex&, const GuardedVertex&) = default;
};

/// A vertex that did not reach its `now`. kNoElement: a geometry that moves by its transform.
struct HeldVertex {
  GeometryId geometry;
  std::uint32_t vertex;
  double fraction;  ///< of its step, in [0, 1)
  friend bool operator==(const HeldVertex&, const HeldVertex&) = default;
};

/// Shortens the steps of vertices and placed bodies until nothing touches within the step of an
/// OctreeBasedCD, which holds the result. Docs/HowTo/Solvers.md has an example.
/// Parts    a vertex, a geometry that setTransform() moves in the step, or a rigid group. A vertex
///          ends at before + fraction * (now - before), rounded, and at `now` for 1; so does a
///          translation. A rotation is the normalised interpolation of the quaternions.
/// Features all pairs are guarded, with filters, predicates and disabled elements, as by
///          Method::Continuous with thickness 0. Features with a common vertex never touch.
/// Radii    a segment counts with its largest radius or, if it begins nearer, with those of 16
///          pieces. Features that restDistance excludes have no radii.
/// Laws     for the step from `before` to the positions after hold(), as Continuous moves it:
///          (1) features without radii do not touch, exactly on the doubles.
///          (2) other features, and shapes, come no nearer than their radii, or where they began,
///          less 2^-33 of their largest coordinate difference and radius and 2^-38 of their motion,
///          and for shapes their own error (Docs/Accuracy.md).
///          (3) a part that touches nothing makes its whole step, unless a shortened one blocks it.
///          (4) only parts that approach are shortened, by their normal motion, so that 1/8 of the
///          room is left. After 8 rounds all parts connected by touches are, to 7/8 of the first
///          touch's time.
///          (5) parts change only their connected component. Parts at rest or fixed connect none.
///          (6) a part keeps a positive fraction, if more than rounding is left before a touch.
///          (7) a second call changes nothing. Results do not depend on threads and order of calls.
/// Start    features that touch when the step begins are a fault, unless a plane separates them
///          then, and strictly at the end. Features with radii, spheres and capsules may overlap
///          and come no nearer; boxes, hulls, cylinders and turning planes must not. Surfaces that
///          cross stay so.
/// Cost     a round is a detection of the pairs that changed. Without a touch there is one; a
///          component takes at most 13 after it was last joined. Steady steps allocate like frames.
/// Errors   UnknownGeometry; InvalidCall after a move or the end of the OctreeBasedCD. An exception
///          changes neither the guard nor the OctreeBasedCD.
class PALPATE_EXPORT StepGuard {
 public:
  /// The OctreeBasedCD may be moved, and destroyed before the guard.
  explicit StepGuard(OctreeBasedCD&);
  StepGuard(StepGuard&&) noexcept;
  StepGuard& operator=(StepGuard&&) noexcept;
  ~StepGuard();

  /// Whether this pair, in either order, is guarded; true at first. Throws UnknownPair.
  void setGuarded(GeometryId a, GeometryId b, bool guarded);
  /// These vertices make one fraction of their steps. Groups with a common vertex join. A group
  /// that turns may deform. Absent vertices do not count. Throws IndexOutOfRange.
  void addRigidGroup(std::span<const GuardedVertex>);
  /// Only these vertices, and groups with one of them, always make their whole step; {kNoElement}:
  /// all. Throws IndexOutOfRange.
  void setFixedVertices(GeometryId, std::span<const std::uint32_t> vertices);

  /// Shortens steps: sets positions and transforms now, and returns the size of held().
  /// Errors   ImpactRemains, with features that touched before the step or move only fixed
  ///          vertices; UnsupportedMethod with a DistanceField; those of detectCollision().
  std::size_t hold();

  /// What the last successful hold() shortened, ascending. Valid until the next hold().
  std::span<const HeldVertex> held() const;
  std::size_t rounds() const;  ///< number of detections in the last successful hold()

 private:
  struct Implementation;
  Implementation& all() const;  ///< throws InvalidCall
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
