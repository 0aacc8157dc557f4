#pragma once

#include <palpate/FeaturePairs.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <optional>

namespace palpate {

/// Two moving features that may touch: their kind, and the positions of their four vertices before
/// and after the step.
///
/// Both kinds of feature pair lead to one problem. With A, B, C moving linearly,
// clang-format off
///   VertexTriangle  (v, a, b, c):      A = b - a,    B = c - a,    C = v - a,    x, y >= 0, x + y <= 1
///   EdgeEdge        (p0, p1, q0, q1):  A = p1 - p0,  B = q0 - q1,  C = q0 - p0,  0 <= x, y <= 1
// clang-format on
/// the features touch where C = x A + y B for some (x, y) in that triangle or square.
struct ImpactQuery {
  enum class Kind { VertexTriangle, EdgeEdge };
  struct Step {
    Eigen::Vector3d before, now;
    const Eigen::Vector3d& at(int end) const { return end == 0 ? before : now; }
  };
  /// A difference of two vertices, by index into `vertices`: minuend, subtrahend.
  using Difference = std::array<int, 2>;

  Kind kind;
  std::array<Step, 4> vertices;

  static constexpr std::array<Difference, 3> axes(Kind kind) {
    if (kind == Kind::VertexTriangle) return {{{2, 1}, {3, 1}, {0, 1}}};
    return {{{1, 0}, {2, 3}, {2, 0}}};
  }
  /// C - x A - y B at the corners of the domain, C first. The features touch when these points
  /// surround zero.
  static constexpr std::array<Difference, 4> corners(Kind kind) {
    if (kind == Kind::VertexTriangle) return {{{0, 1}, {0, 2}, {0, 3}}};  // only three
    return {{{2, 0}, {2, 1}, {3, 0}, {3, 1}}};
  }
};

/// The result of an impact test.
struct ImpactResult {
  bool impact = false;
  bool exact = false;  ///< floating point could not decide
  double time = 0.0;   ///< [0, 1] of the step; valid if there is an impact
};

/// The same as vertexTriangleTimeOfImpact and edgeEdgeTimeOfImpact, limited to times in [0, upTo].
/// An impact after upTo may be missed. The time of an impact that is found does not depend on upTo.
ImpactResult findImpact(const ImpactQuery&, const TimeOfImpactSettings&, double upTo = 1.0);

/// findImpact() for a distance of 0; tolerance in [2^-50, 1]. Floating point first, then exact
/// arithmetic.
ImpactResult findTouch(const ImpactQuery&, double tolerance, double upTo = 1.0);
/// The same result by exact arithmetic alone.
ImpactResult findTouchExactly(const ImpactQuery&, double tolerance);
/// findImpact() for a distance > 0: when the features come within it.
ImpactResult findApproach(const ImpactQuery&, double distance, double tolerance, double upTo = 1.0);

/// The moments at which features pass through each other (Crossing in palpate/Tracking.h).
struct Passages {
  struct Passage {
    double time;   ///< at most the tolerance before the exact time, never after it
    bool forward;  ///< A x B · C becomes positive
  };
  std::array<Passage, 3> all{};  ///< ascending; a cubic has no more roots
  int count = 0;
  bool exact = false;  ///< floating point could not decide
};
struct Surroundings;  // Math/MovingStar.h
/// around: decides touches at borders for all features that meet there; null: a feature's border
/// belongs to it.
Passages findPassages(const ImpactQuery&, double tolerance, const Surroundings* around = nullptr);
/// findPassages() by exact arithmetic alone.
Passages findPassagesExactly(const ImpactQuery&, double tolerance,
                             const Surroundings* around = nullptr);

/// The side of the contact plane on which the first feature last was before the time. 1: the side
/// of A x B, towards which C points; this is the triangle's winding normal, or (p1 - p0) x (q0 -
/// q1). -1: the other side. 0: it was always in the plane. exactDecisions: incremented if floating
/// point could not decide.
int sideBefore(const ImpactQuery&, double time, std::size_t* exactDecisions = nullptr);

/// The vertices at a time of the step, relative to the first vertex. Differences thus stay accurate
/// far from the origin, where positions would be rounded. If the differences overflow, positions
/// are absolute.
std::array<Eigen::Vector3d, 4> positionsAt(const ImpactQuery&, double time);
/// From where the first feature comes to a touch, seen from the second one. Both are unit vectors.
struct Approach {
  /// From the second feature to the first, just before the touch. It is perpendicular to the edges
  /// that hold the closest points, and right to some 2^-20.
  Eigen::Vector3d side;
  /// Against the relative motion of the two points that meet; zero if they do not move.
  Eigen::Vector3d origin;
};
/// None if the features touch from the step's start on: no side exists then.
std::optional<Approach> approachOf(const ImpactQuery&, double time);
/// The normal of the plane through a touch, on the side where the first feature was before. None if
/// the four vertices were always in one plane, as those of parallel edges are.
std::optional<Eigen::Vector3d> normalOfPlane(const ImpactQuery&, double time,
                                             std::size_t& exactDecisions);

}  // namespace palpate
