#pragma once

#include <palpate/Settings.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// Why the library answered a pair by Validity::method.
enum class MethodReason {
  Requested,  ///< The pair's settings name the method.
  // The reasons of Method::Auto. Motion is that of features in the step, relative to each other.
  Still,  ///< Nothing moves: Proximity, or Intersection for two meshes without a thickness.
  Slow,   ///< All features move at most PairSettings::motionTolerance: Proximity.
  Fast,   ///< All or most features move further: Continuous.
  Mixed,  ///< Some features move further: Continuous for them, Proximity for the rest.
  /// Continuous costs least, whatever the motion: without a thickness, and with Contacts::All,
  /// where Proximity would report every feature pair within the enlarged thickness.
  Cheapest,
  /// The pair has lines, points or shapes, and no other method answers it as well. Continuous, if
  /// features move, or if Proximity would need a thickness or a radius. Proximity, if Continuous
  /// does not answer the pair: then impacts within the step may be missing.
  NoAlternative
};

/// Whether the last answer for one pair can be trusted, and what the library knows about the step.
/// Each method relies on conditions, and each detectCollision() checks them.
///
/// Laws     (1) if trusted, and the method is Proximity, Continuous or Auto: every normal is on the
///          side from which its features came, and no features that touched or crossed within the
///          step are missing. With Contacts::Distinct another contact may stand for them, and
///          filters may refuse their contacts.
///          (2) if trusted, and the method is Intersection: if the meshes touched within the step,
///          the answer is not empty.
///          (3) if not trusted, the library does not know. Pairs with lines, points or shapes, and
///          pairs that collision filters separate, are never trusted.
/// Cost     a small part of the frames' time (Docs/Performance.md), except in the first frame of a
///          pair. That frame has an initial intersection check. If later motion may have brought
///          the meshes together, and the step's impacts do not decide it, the library repeats the
///          check: with Auto at once, with other methods at most once in 16 frames on average.
/// Source   Docs/Algorithms/Validity.md has the conditions and their proofs.
struct Validity {
  bool trusted = false;
  /// Whether the geometries are known not to intersect at the step's start. The library knows it
  /// from an initial intersection check, or from earlier frames and bounds on the motion since. If
  /// false, normals may be on the wrong side. Method::Intersection does not need it and runs no
  /// check.
  bool startedApart = false;
  /// Whether some normal may be on the wrong side. Never true for Method::Intersection.
  bool sideMayBeWrong = true;

  /// The method that answered. Auto stands for Proximity and Continuous, feature by feature.
  Method method = Method::Auto;
  MethodReason reason = MethodReason::Requested;
  /// Number of contacts from the step's end, by distance or intersection; and number of contacts
  /// from within the step, by impact.
  std::size_t atEnd = 0, atImpact = 0;

  /// L: upper bound on the motion of any two features in the step, relative to each other.
  double displacement = 0;
  /// L: the largest `displacement` that meets the method's condition. Proximity: the thickness.
  /// Auto: the motion tolerance, which only chooses the method. Intersection: the smallest height
  /// of a triangle, measured when the topology was set. Continuous: infinity.
  double displacementLimit = 0;
  /// L: how far the straight motion of vertices is off the arcs of bodies that setTransform()
  /// turns. It bounds the distance of a vertex from its path if the body turned evenly about one
  /// axis and slid along it. It is the sum over both bodies, and infinity for a plane that turns.
  /// If it exceeds the thickness, the answer is not trusted.
  double arcDeviation = 0;
  /// L: feature pairs further apart at the step's end are contacts only by an impact. It is the
  /// thickness, with Auto up to the motion tolerance more; 0 for Intersection.
  double effectiveThickness = 0;

  /// Vertices of the first and of the second mesh because of which the answer is not trusted,
  /// ascending. They moved further than `displacementLimit`, or belong to features that may have
  /// touched within the step although they are apart at its end. For a mesh with itself all are in
  /// the first list.
  std::vector<std::uint32_t> untrustedVerticesA, untrustedVerticesB;
  /// Triangles without area that are in contacts, ascending. Their normals follow the rules of
  /// <palpate/Distance.h>.
  std::vector<std::uint32_t> degenerateTrianglesA, degenerateTrianglesB;

  /// Maximum number of vertices of one mesh that are listed because they moved too far.
  static constexpr std::size_t kMaxFastVertices = 128;

  /// A value above 1 means that the motion violates the method's condition.
  double displacementOverLimit() const {
    return displacement > 0 ? displacement / displacementLimit : 0;
  }

  friend bool operator==(const Validity&, const Validity&) = default;
};

}  // namespace palpate
