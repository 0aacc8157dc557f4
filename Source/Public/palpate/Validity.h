#pragma once

#include <palpate/Export.h>
#include <palpate/Settings.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// Why the library answered a pair by Validity::method. It names the main method only: if a step
/// begins in intersection, Auto adds contacts of Intersection, whatever the reason is.
enum class MethodReason {
  Requested,  ///< The pair's settings name the method. Also the value of a separated pair.
  // The reasons of Method::Auto. Motion is that of features in the step, relative to each other.
  Still,  ///< Nothing moves: Proximity, or Intersection for two meshes without a thickness.
  /// All features move at most AutoSettings::motionTolerance: Proximity. Features that may have
  /// touched in the step are reported by their impact even so.
  Slow,
  Fast,   ///< All or most features move further: Continuous.
  Mixed,  ///< Some features move further: Continuous for them, Proximity for the rest.
  /// Continuous costs least, whatever the motion: without a thickness, and with Contacts::All,
  /// where Proximity would report every feature pair within the enlarged thickness.
  Cheapest,
  /// The pair has lines, points or shapes, and no other method answers it as well. Continuous, if
  /// features move, or if Proximity would need a thickness or a radius. Proximity, if Continuous
  /// does not answer the pair: then impacts within the step may be missing. DistanceField, if one
  /// of the two is a geometry of addDistanceField().
  NoAlternative,
  /// An attached DistanceField or proxy is within PairSettings::allowedError, and proves that
  /// nothing touched in the step: DistanceField or Proxy. With Proxy, the exact method answers
  /// particles for which this is not proven. Otherwise the reason is that of the exact method.
  AllowedError
};
PALPATE_EXPORT const char* toString(MethodReason) noexcept;  ///< its name, or "unknown"

/// Whether the last answer for one pair can be trusted, and what the library knows about the step.
/// Each method relies on conditions, and each detectCollision() checks them. Docs/HowTo/Validity.md
/// says what to do in each case.
/// Laws     (1) if trusted, and `method` is Proximity, Continuous or Auto: every normal is on the
///          side from which its features came, and no features that touched or crossed within the
///          step are missing. With Contacts::Distinct another contact may stand for them, and
///          filters may refuse their contacts. Disabled elements count as absent.
///          (2) if trusted, and `method` is Intersection: if the meshes touched within the step,
///          the answer is not empty. Normals are not certified, and the meshes may intersect. This
///          also holds where Auto answers by Intersection: at rest, without a thickness.
///          (3) if not trusted, the answer may be right or wrong. Continuous and Auto miss no
///          impact of straight motion even so, except where Auto answers lines and points with one
///          radius per vertex. Only sides are then not certified, and impacts on the arcs of bodies
///          that turn. Answers of DistanceField and of Proxy are never trusted, nor are pairs that
///          collision filters separate.
///          (4) the laws are about one step. Features may have passed each other in an earlier
///          step, because its answer missed it or because the solver ignored an impact. The next
///          step may then be trusted, with startedApart, and its normals push further through.
///          Remember steps that were not trusted, or end steps with StepGuard.
///          (5) the laws are about surfaces. A closed mesh wholly inside another intersects no
///          surface: its answers may be trusted, and its normals push it deeper. Queries find it
///          (SpatialQueries::findInsideVertices()). Shapes and radii are solid.
/// Cost     a small part of the frames' time, and more in frames that run the initial intersection
///          check (Docs/Algorithms/Validity.md, "Cost").
/// Source   Docs/Algorithms/Validity.md has the conditions and their proofs.
struct Validity {
  /// Whether the conditions of `method` held in this step. The laws say what follows from it.
  bool trusted = false;
  /// Whether the surfaces are known neither to intersect nor to touch at the step's start, from
  /// distances there, an initial intersection check, or earlier frames and bounds on the motion
  /// since. Lines and points count with their radii, and shapes are solid; a mesh may be wholly
  /// inside another. If false, they intersect or touch, or the library does not know. By
  /// Auto they do, radii and shapes within rounding, unless `method` is Intersection, DistanceField
  /// or Proxy, or Proximity with one radius per vertex. How deep radii and shapes overlap is the
  /// negative `distance` of contacts at time 0, at rest at time 1. Proximity whose `displacement`
  /// exceeds its limit checks nothing.
  bool startedApart = false;
  /// Whether some normal may be on the wrong side, if `method` is Proximity, Continuous or Auto: it
  /// is then the opposite of `trusted`. Intersection knows no sides, and the value is always false
  /// there, which is no all-clear. Auto, too, answers by Intersection, at rest without a thickness.
  /// The normals of Intersection are never certified: those of vertices point to the front of the
  /// triangle, and those of edges to the side on which the surfaces at both edges are outside.
  bool sideMayBeWrong = true;
  /// Whether the pair is of a mesh with itself, no two of whose triangles share a vertex although
  /// some have vertices at the same place, as those of an STL file. Triangles that are neighbours
  /// are then in contact, and the answer is not trusted. weld() joins them. Found when elements are
  /// set or enabled, from the positions of that frame.
  bool unwelded = false;

  /// The main method that answered. Auto stands for Proximity and Continuous, feature by feature.
  /// Single contacts of Auto may come from another method: see `atImpact`, and MethodReason. This
  /// field decides what `trusted` promises. PairSettings::method, the requested one, decides which
  /// fields name the cause of an answer that is not trusted.
  Method method = Method::Auto;
  /// Why `method` answered.
  MethodReason reason = MethodReason::Requested;
  /// Number of contacts that describe the step's end, by distance or by intersection.
  std::size_t atEnd = 0;
  /// Number of contacts that describe an impact. Both numbers are 0 with
  /// ContinuousSettings::earliestTimeOnly, which gives no contacts.
  std::size_t atImpact = 0;

  /// L: upper bound on the motion of any two features in the step, relative to each other. Of a
  /// cylinder that turns the rim counts, too. A plane that turns has no such bound; the value is
  /// then that of one of its points.
  double displacement = 0;
  /// L: with Proximity and Intersection, the largest `displacement` that meets the method's
  /// condition: the thickness; the smallest height of a triangle, measured when the topology was
  /// set. Method::Auto with two meshes: the motion tolerance, which chooses the method and is no
  /// condition. Continuous, also as chosen by Auto for other pairs: infinity.
  double displacementLimit = 0;
  /// L: how far the straight motion of vertices is off the arcs of bodies that setTransform()
  /// turns. It bounds the distance of a vertex from its path if the body turned evenly about one
  /// axis and slid along it. It is the sum over both bodies, and infinity for a plane that turns.
  /// If it exceeds the thickness, the answer is not trusted. With Proximity, it and `displacement`
  /// together must not exceed the thickness.
  double arcDeviation = 0;
  /// L: feature pairs further apart at the step's end are contacts only by an impact. It is the
  /// thickness, with Auto up to the motion tolerance more, also where a field or a proxy answers; 0
  /// for Intersection.
  double effectiveThickness = 0;
  /// L: if `method` is Proxy, particles deeper than this behind the surface of a closed mesh are
  /// not reported. It is at least the thickness and the largest radius, and the edge of the
  /// smallest leaf. Meshes that are not closed have no inside: particles within the thickness are
  /// reported on both sides. 0 for other methods.
  double proxyDepth = 0;

  /// Vertices of the first and of the second geometry because of which the answer is not trusted,
  /// ascending. Proximity and Intersection: vertices that moved further than `displacementLimit`,
  /// at most kMaxFastVertices of each geometry, those with the lowest ids. Motion is relative to
  /// the other geometry, so vertices of a geometry at rest are listed, too. Proximity: also
  /// vertices of features that may have touched within the step although they are apart at its end.
  /// Both lists are empty for Method::Auto with two meshes, for Continuous, and for pairs with a
  /// shape. For a geometry with itself all are in the first list.
  std::vector<std::uint32_t> untrustedVerticesA, untrustedVerticesB;
  /// Triangles of meshes without area that are in contacts, ascending. Their normals follow the
  /// rules of <palpate/FeaturePairs.h>. Empty for pairs with a shape.
  std::vector<std::uint32_t> degenerateTrianglesA, degenerateTrianglesB;

  /// Indices of contacts in CollisionData::shape(), ascending, if `method` is DistanceField. The
  /// first are beyond the field's band, or may be: deeper inside than the band less the error
  /// bound. The error bound does not hold for them; they are at least as deep as their distance
  /// says, less that bound. The second are nearer to the thickness than the error bound: their
  /// exact distance may be larger than it.
  std::vector<std::uint32_t> outsideBand, nearThreshold;
  /// Indices of contacts in CollisionData::shape(), ascending, if `method` is DistanceField and the
  /// field is of an open mesh: those at points where DistanceField::signIsReliable() is false.
  /// Their distance is not negative (but for radii), although the point may be inside.
  std::vector<std::uint32_t> unreliableSign;

  /// Maximum number of vertices of one geometry that are listed because they moved too far.
  static constexpr std::size_t kMaxFastVertices = 128;

  /// A value above 1 means that the motion violates the method's condition, if PairSettings::method
  /// is Proximity or Intersection. For Method::Auto with two meshes it means only that Proximity
  /// alone does not answer the step: trusted answers have values above 1, and infinity without a
  /// thickness.
  double displacementOverLimit() const {
    return displacement > 0 ? displacement / displacementLimit : 0;
  }

  friend bool operator==(const Validity&, const Validity&) = default;
};

}  // namespace palpate
