#pragma once

#include <palpate/Settings.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// Why a pair was answered by the method that it was answered by.
enum class MethodReason {
  Asked,  ///< the pair's settings name it
  // Method::Auto, by how far features move in the step, relative to each other:
  Still,  ///< not at all: Proximity, or Intersection for two meshes without a thickness
  Slow,   ///< all at most PairSettings::motionTolerance: Proximity
  Fast,   ///< all, or most, further: Continuous
  Mixed,  ///< some further: Continuous for those, Proximity for the rest
  /// At most the motion tolerance or not, Continuous costs least: without a thickness, and with
  /// Contacts::All, where distances of everything near would be asked for.
  Cheapest,
  /// A pair with lines, points or shapes: no other method answers it as well. Continuous where
  /// features move, or where Proximity would need a thickness or a radius. Proximity where
  /// Continuous does not answer the pair: what passes within the step may then be missing.
  Only
};

/// What one pair's method assumes, and whether the last frame kept to it.
///
/// trusted  Proximity, Continuous, Auto: every normal is on the side from which its features came,
/// and
///          no features that touched or crossed within the step are missing, save those for which
///          Contacts::Distinct reports another contact. Intersection: that the
///          meshes touched within the step is not missing.
///          False where the library does not know; never true where it is wrong.
/// Cost     at most 5 % of the frames, but for a look at the step's start in the pair's first one.
///          Where motion may have brought the meshes together since, and the step's impacts do not
///          tell, that is taken again, by Auto at once, else once in sixteen frames.
/// Source   Docs/Algorithms/Validity.md has the conditions and their proofs.
struct Validity {
  bool trusted = false;
  /// Nothing intersected at the step's start: found, or carried over from earlier frames by bounds
  /// on motion. Without it sides may be wrong. Intersection does not ask.
  bool startedApart = false;
  bool sideMayBeWrong = true;  ///< of some normal. Of Intersection's, never

  Method method =
      Method::Auto;  ///< that answered; Auto: Proximity and Continuous, feature by feature
  MethodReason reason = MethodReason::Asked;
  /// Contacts found at the step's end by their distance, and within the step by their impact.
  std::size_t atEnd = 0, atImpact = 0;

  double displacement = 0;  ///< L: no two features moved further, relative to each other
  /// L: what displacement must not exceed. Proximity: the thickness. Auto: the motion tolerance,
  /// which only chooses the method. Intersection: the smallest height of a triangle when its
  /// topology was set. Continuous: infinity.
  double reach = 0;
  /// L: vertices move in straight lines within a step. Where setTransform() turns a body no vertex
  /// is further than this from the way it would take if the body turned evenly about one axis and
  /// slid along it; of two bodies the sum, of a plane that turns infinity. Beyond the thickness
  /// nothing is trusted.
  double arcDeviation = 0;
  /// L: pairs further apart at the step's end are no contacts, unless by an impact: the thickness,
  /// or with Auto up to the motion tolerance more.
  double thickness = 0;

  /// Vertices of the first and the second mesh that broke the condition, ascending: those that
  /// moved further than the reach allows, and those of features that the step may have brought
  /// together although they are apart at its end. Self-collision: all are in the first list.
  std::vector<std::uint32_t> verticesBeyondA, verticesBeyondB;
  /// Triangles without area in contacts, ascending: their normals are those documented.
  std::vector<std::uint32_t> degenerateTrianglesA, degenerateTrianglesB;

  static constexpr std::size_t kMostFarMovers = 128;  ///< of a mesh that are listed

  /// Above 1 the motion is beyond the method's condition.
  double displacementOverReach() const { return displacement > 0 ? displacement / reach : 0; }

  friend bool operator==(const Validity&, const Validity&) = default;
};

}  // namespace palpate
