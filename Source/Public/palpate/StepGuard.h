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

/// A vertex that StepGuard::hold() did not let reach its `now`. kNoElement: a geometry that moves
/// by its transform, as a whole.
struct HeldVertex {
  GeometryId geometry;
  std::uint32_t vertex;
  double fraction;  ///< of its step, in [0, 1)
  friend bool operator==(const HeldVertex&, const HeldVertex&) = default;
};

/// Prevents geometries from passing through each other at the end of a solver's step: after its
/// last correction, hold() shortens the steps of vertices and placed bodies until nothing touches
/// within the step. The positions and transforms of the OctreeBasedCD are to be used from there on.
/// Docs/HowTo/Solvers.md has an example.
/// Parts     A vertex is a part, and so is a geometry that setTransform() moves in the step, and a
///           rigid group. A part makes a fraction of its step: a vertex ends at before + fraction *
///           (now - before), rounded, and exactly at `now` for 1. The translation of a placed
///           geometry changes likewise. Its rotation is the normalised interpolation of the
///           quaternions, so that it stays rigid.
/// Features  all pairs of the OctreeBasedCD are guarded, with its filters, predicates and disabled
///           elements, whatever their method and thickness. A vertex and a triangle, or two edges,
///           touch as in Method::Continuous with thickness 0, also at the first or last moment
///           only. Features of one geometry with a common vertex never touch.
/// Radii     lines and points with a radius, and shapes, touch where the surfaces of their radii
///           or the shape do. A segment whose radius varies counts with its largest radius, or if
///           it begins nearer than that, with the radii of 16 pieces. What restDistance excludes
///           from contacts is guarded without its radii.
/// Laws      After hold(), for the step from `before` to the positions now, as Continuous moves it:
///           (1) features without radii do not touch. This is decided exactly on the doubles.
///           (2) features with radii, and elements and shapes, come no nearer than their radii, or
///           than where they began if that is nearer, less 2^-33 of their largest coordinate
///           difference and radius and 2^-38 of their motion. For shapes this holds up to their
///           own error (Docs/Accuracy.md).
///           (3) a part that would touch nothing makes its whole step, unless shortening the
///           step of another one brings that into its way.
///           (4) of a touch, only parts that approach are shortened: by their normal motion, so
///           that 1/8 of the room in front of them is left. What moves away or along is free. If
///           that does not help in 8 rounds, all parts that are connected by touches are shortened
///           by one factor: to 7/8 of the time of the first touch.
///           (5) parts of one connected component do not change those of another one. Parts that
///           are at rest or fixed do not connect others.
///           (6) a part that moves keeps a positive fraction, unless less than rounding is left
///           between it and what it would touch.
///           (7) a second call changes nothing.
/// Start     Features that touch when the step begins are a fault, except if they certainly part:
///           if they are on two sides of a plane then, and strictly so at the step's end.
///           Features with radii, and spheres and capsules, may overlap when the step begins, and
///           come no nearer. A box, hull, cylinder or turning plane must not: no direction is
///           known in which that can be proven.
/// Limits    surfaces that cross already at `before` stay as they are: only features that touch
///           count. Method::Intersection and Validity::startedApart find such surfaces.
/// Cost      each round is one detection of the pairs whose positions changed since the round
///           before, with the octrees of the OctreeBasedCD. A step without a touch takes one. A
///           component takes at most 13 rounds after it was last joined by another part, if it is
///           held at all; components take theirs at the same time. Steady steps allocate nothing,
///           except for integers of exact arithmetic (Docs/Guarantees.md, "Memory").
/// Order     results depend neither on the number of threads nor on the order of calls.
/// Errors    every function throws palpate::Error for invalid data, and then changes neither the
///           guard nor the OctreeBasedCD. Every function that takes a GeometryId throws
///           UnknownGeometry. After a move, and once the OctreeBasedCD was destroyed, every
///           function except assignment and destruction throws InvalidCall.
/// Threads   hold() counts as a call of the OctreeBasedCD that changes it.
class PALPATE_EXPORT StepGuard {
 public:
  /// The OctreeBasedCD may be moved, and may be destroyed before the guard.
  explicit StepGuard(OctreeBasedCD&);
  StepGuard(StepGuard&&) noexcept;
  StepGuard& operator=(StepGuard&&) noexcept;
  ~StepGuard();

  /// Whether features of this pair, in either order, must not touch. True for every pair at first.
  /// Errors   UnknownPair.
  void setGuarded(GeometryId a, GeometryId b, bool guarded);
  /// These vertices make one fraction of their steps. Groups with a common vertex become one group.
  /// Use setTransform() for a rigid body: a group does not stay rigid while it turns. Groups of
  /// placed geometries are for tools of several parts. A vertex that does not exist when hold() is
  /// called does not count.
  /// Errors   IndexOutOfRange.
  void addRigidGroup(std::span<const GuardedVertex>);
  /// These vertices of a geometry always make their whole step; none is fixed but these.
  /// {kNoElement}: all, or a shape. Use it for a tool that nothing holds. A group with a fixed
  /// vertex is fixed. If hold() throws ImpactRemains, set the `now` of these vertices to `before`
  /// and call it again. Vertices that a hand drives need not be fixed: hold() may then shorten
  /// their step, and the hand has to wait.
  /// Errors   IndexOutOfRange.
  void setFixedVertices(GeometryId, std::span<const std::uint32_t> vertices);

  /// Shortens the steps of vertices and placed geometries of the OctreeBasedCD: sets their
  /// positions and transforms now. Its results stay readable.
  /// Returns  the size of held().
  /// Errors   ImpactRemains if features touch and cannot be shortened: they touched before the
  ///          step, or all their vertices that move are fixed. The message names geometries and
  ///          features. UnsupportedMethod for a pair with a DistanceField, which has no features.
  ///          Those of OctreeBasedCD::detectCollision().
  std::size_t hold();

  /// The vertices and placed geometries whose steps the last successful hold() shortened,
  /// ascending. The span is valid until the next hold().
  std::span<const HeldVertex> held() const;
  std::size_t rounds() const;  ///< number of detections in the last successful hold()

 private:
  struct Implementation;
  Implementation& all() const;  ///< throws InvalidCall
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
