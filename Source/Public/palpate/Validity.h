#pragma once

#include <palpate/Export.h>
#include <palpate/Settings.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// Why Validity::method answered. Auto may add contacts of other methods.
enum class MethodReason {
  Requested,  ///< The pair's settings name the method. Also the value of a separated pair.
  // The reasons of Method::Auto. Motion is that of features in the step, relative to each other.
  Still,  ///< Nothing moves: Proximity, or Intersection for two meshes without a thickness.
  /// All features move at most AutoSettings::motionTolerance: Proximity, and impacts.
  Slow,
  Fast,   ///< All or most features move further: Continuous.
  Mixed,  ///< Some features move further: Continuous for them, Proximity for the rest.
  /// Continuous costs least: without a thickness, and with Contacts::All.
  Cheapest,
  /// Lines, points or shapes: Continuous if features move or Proximity lacks a thickness or radius,
  /// else Proximity. One radius per vertex: Proximity, may miss impacts. A field: DistanceField.
  /// Meshes that move, with reportCrossings or rememberSides: Continuous.
  NoAlternative,
  /// An attached DistanceField or proxy within allowedError proves that nothing touched.
  AllowedError,
  /// The last detection had no time for the pair: this is the answer of an earlier one, or empty.
  OutOfTime
};
PALPATE_EXPORT const char* toString(MethodReason) noexcept;  ///< its name, or "unknown"

/// Whether the last answer for a pair can be trusted, and what is known about the step.
/// Laws     (1) if trusted by Proximity, Continuous or Auto: every normal is on the side from which
///          its features came, and no features that touched or crossed within the step are missing.
///          With Contacts::Distinct another contact may stand for them; filters may refuse them.
///          (2) if trusted by Intersection, also of Auto at rest without a thickness: if the meshes
///          touched within the step, the answer is not empty. Normals are not certified.
///          (3) if not trusted, Continuous and Auto still miss no impact of straight motion, except
///          where Auto answers with one radius per vertex. DistanceField, Proxy and pairs separated
///          by filters are never trusted.
///          (4) the laws are about one step and about surfaces: not about a passage in an earlier
///          step, nor a closed mesh wholly inside another. Shapes and radii are solid.
/// Source   Docs/Algorithms/Validity.md has the conditions, their proofs and the cost.
struct Validity {
  bool trusted = false;  ///< whether the conditions of `method` held in this step
  /// Whether surfaces are known neither to intersect nor to touch at the step's start. False: Auto
  /// knows that they do, radii and shapes within rounding, except by Intersection, DistanceField,
  /// Proxy, or Proximity with a radius per vertex; other methods may not know.
  bool startedApart = false;
  /// The opposite of `trusted`. By Intersection it is false, although no side is certified.
  bool sideMayBeWrong = true;
  /// A mesh with itself had equal positions when its topology was set, but its triangles share no
  /// vertex: not trusted.
  bool unwelded = false;

  /// The main method, to which the laws refer. Auto: Proximity and Continuous, by feature.
  Method method = Method::Auto;
  MethodReason reason = MethodReason::Requested;  ///< why `method` answered
  std::size_t atEnd = 0;                          ///< number of contacts at the step's end
  std::size_t atImpact = 0;                       ///< number of impacts; both 0 by earliestTimeOnly

  /// L: upper bound on the motion of any two features relative to each other; of a plane that
  /// turns, that of one of its points.
  double displacement = 0;
  /// L: the largest `displacement` that meets the condition: of Proximity the thickness, of
  /// Intersection the smallest height of a triangle when topology was set, of Continuous infinity.
  /// Of Auto with two meshes it is the motion tolerance, which is no condition.
  double displacementLimit = 0;
  /// L: how far straight motion is off the arcs of turning bodies, as a sum; infinity for a plane.
  /// Above the thickness, for Proximity with `displacement` added, no answer is trusted.
  double arcDeviation = 0;
  /// L: the thickness, by Auto up to the motion tolerance more, 0 for Intersection. Feature pairs
  /// further apart at the step's end are contacts only by an impact.
  double effectiveThickness = 0;
  /// L: Proxy does not report particles deeper in a closed mesh. 0 for other methods.
  double proxyDepth = 0;

  /// Detections since the one that this answer is of, or the first one if it is empty for lack of
  /// time. Above 0 `reason` is OutOfTime, and the answer is not trusted.
  std::uint32_t age = 0;

  /// A geometry of the pair was set again in this step, and the motions added up: twice without a
  /// detection between, or four times. A call of advance() may be missing. The answer is that of
  /// the whole motion since the last one.
  bool advanceMayBeMissing = false;

  /// Vertices that make the answer untrusted, ascending. By Proximity and Intersection: the first
  /// kMaxFastVertices of each geometry with a relative motion above `displacementLimit`; by
  /// Proximity also those that may have touched within the step. Else, and with shapes: none.
  /// Self-collision: all in A.
  std::vector<std::uint32_t> untrustedVerticesA, untrustedVerticesB;
  /// Triangles without area in contacts, ascending. Empty for pairs with a shape.
  std::vector<std::uint32_t> degenerateTrianglesA, degenerateTrianglesB;

  /// DistanceField: indices in CollisionData::shape(), ascending. First: maybe beyond the band, and
  /// at least as deep as `distance` less errorBound(). Second: maybe beyond the thickness.
  std::vector<std::uint32_t> outsideBand, nearThreshold;
  /// The same where DistanceField::signIsReliable() is false: the point may be inside.
  std::vector<std::uint32_t> unreliableSign;

  static constexpr std::size_t kMaxFastVertices = 128;

  /// Above 1 the motion violates the condition of a requested Proximity or Intersection.
  double displacementOverLimit() const {
    return displacement > 0 ? displacement / displacementLimit : 0;
  }

  friend bool operator==(const Validity&, const Validity&) = default;
};

}  // namespace palpate
