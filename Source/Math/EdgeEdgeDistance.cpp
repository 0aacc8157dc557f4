#include "Math/ClosestPoint.h"
#include "Math/ExactClosestPoint.h"
#include "Math/FilteredSigns.h"
#include "Math/Foot.h"
#include "Core/FloatingPoint.h"

#include <array>
#include <limits>
#include <optional>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;

Vector3d crossingNormal(const EdgePair& edges) {
  return normalOfCrossing(edges.p0, edges.p1, edges.q0, edges.q1);
}

struct CrossingDecision {
  Crossing crossing;
  bool exact;
};

CrossingDecision crossingOf(const EdgePair& edges) {
  const Vector3d &m = edges.m.high, &u = edges.u.high, &v = edges.v.high;
  const double uSum = sumOfMagnitudes(u), vSum = sumOfMagnitudes(v), magnitude = uSum * vSum;
  // m was rounded in terms as large as the edges at least.
  const double mSum = sumOfMagnitudes(m) + uSum + vSum;
  if (mSum < kLargestModerate) {
    const Vector3d normal = u.cross(v);
    const double square = dot(normal, normal), squareError = kTripleError * magnitude * magnitude;
    const double s = std::abs(dot(m.cross(v), normal)), t = std::abs(dot(u.cross(m), normal));
    const double sError =
        kTripleError * mSum * vSum * magnitude + squareError + kUnderflowGuardOfProducts;
    const double tError =
        kTripleError * mSum * uSum * magnitude + squareError + kUnderflowGuardOfProducts;
    if (s - square > sError || t - square > tError) return {Crossing::Outside, false};
    if (square - s > sError && square - t > tError) return {Crossing::Interior, false};
  }
  return {exact::crossing(edges.p0, edges.p1, edges.q0, edges.q1), true};
}

EdgeEdgeDistance interiorDistance(const EdgePair& edges, bool decidedExactly) {
  const Foot foot = footBetweenEdges(edges);
  const Vector3d normal = foot.distance == 0.0 ? crossingNormal(edges) : foot.direction;
  return {foot.s,
          foot.t,
          foot.difference,
          normal,
          foot.distance,
          EdgeFeature::Interior,
          EdgeFeature::Interior,
          false,
          decidedExactly || foot.exact};
}

/// One edge's end against the other edge.
struct EndFoot {
  Foot foot;
  EdgeFeature feature;
};

EndFoot footOfEnd(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  if (!comesNearer(p, a, b)) return {footOnPoint(p, a), EdgeFeature::Start};
  if (comesNearer(p, b, a)) return {footOnLine(p, a, b), EdgeFeature::Interior};
  EndFoot end{footOnPoint(p, b), EdgeFeature::End};
  end.foot.s = 1.0;
  return end;
}

/// Whether p lies beside edge ab, not beyond one of its ends.
bool isBeside(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  return a != b && exact::along(p, a, b) >= 0 && exact::along(p, b, a) >= 0;
}

EdgeFeature featureAt(double weight) {
  if (weight == 0.0) return EdgeFeature::Start;
  return weight == 1.0 ? EdgeFeature::End : EdgeFeature::Interior;
}

/// The four ends, each against the other edge: p0, p1, q0, q1.
class EndFeet {
 public:
  explicit EndFeet(const EdgePair& edges)
      : m_edges(edges),
        m_ends{footOfEnd(edges.p0, edges.q0, edges.q1), footOfEnd(edges.p1, edges.q0, edges.q1),
               footOfEnd(edges.q0, edges.p0, edges.p1), footOfEnd(edges.q1, edges.p0, edges.p1)} {}

  double weightA(int i) const { return i < 2 ? static_cast<double>(i) : m_ends[i].foot.s; }
  double weightB(int i) const { return i < 2 ? m_ends[i].foot.s : static_cast<double>(i - 2); }

  /// tied: another pair of points is as near, within rounding.
  int nearest(bool& tied) const {
    int nearest = 0;
    for (int i = 1; i < 4; ++i)
      if (distance(i) < distance(nearest)) nearest = i;
    for (int i = 0; i < 4; ++i) {
      const bool samePair = weightA(i) == weightA(nearest) && weightB(i) == weightB(nearest);
      tied = tied || (!samePair && distance(i) <= kTie * distance(nearest));
    }
    return nearest;
  }

  EdgeEdgeDistance answer(int i) const {
    const auto& [foot, feature] = m_ends[i];
    const double turn = i < 2 ? 1.0 : -1.0;
    const Vector3d normal =
        foot.distance == 0.0 ? crossingNormal(m_edges) : Vector3d(turn * foot.direction);
    return {weightA(i),
            weightB(i),
            turn * foot.difference,
            normal,
            foot.distance,
            i < 2 ? static_cast<EdgeFeature>(i) : feature,
            i < 2 ? feature : static_cast<EdgeFeature>(i - 2),
            false,
            foot.exact};
  }

  /// Moves the answer for parallel edges to the middle of the stretch that they share, which runs
  /// from end to end.
  void moveToMiddle(EdgeEdgeDistance& answer) const {
    const auto& [p0, p1, q0, q1, m, u, v] = m_edges;
    const std::array<bool, 4> beside{isBeside(p0, q0, q1), isBeside(p1, q0, q1),
                                     isBeside(q0, p0, p1), isBeside(q1, p0, p1)};
    // Both weights: on an edge without length the other's are equal.
    const auto before = [&](int i, int j) {
      return std::pair(weightA(i), weightB(i)) < std::pair(weightA(j), weightB(j));
    };
    int low = -1, high = -1;
    for (int i = 0; i < 4; ++i) {
      if (!beside[i]) continue;
      if (low < 0 || before(i, low)) low = i;
      if (high < 0 || before(high, i)) high = i;
    }
    if (low == high) return;
    answer.weightA = 0.5 * weightA(low) + 0.5 * weightA(high);
    answer.weightB = 0.5 * weightB(low) + 0.5 * weightB(high);
    answer.featureA = featureAt(answer.weightA);
    answer.featureB = featureAt(answer.weightB);
  }

 private:
  double distance(int i) const { return m_ends[i].foot.distance; }

  const EdgePair& m_edges;
  std::array<EndFoot, 4> m_ends;
};

/// The closest points of edges of which at least one is met at an end.
EdgeEdgeDistance endDistance(const EdgePair& edges, bool parallel, bool decidedExactly) {
  const EndFeet ends(edges);
  bool tied = false;
  int nearest = ends.nearest(tied);
  if (tied && !parallel) nearest = exact::nearestEnd(edges.p0, edges.p1, edges.q0, edges.q1);
  EdgeEdgeDistance answer = ends.answer(nearest);
  answer.exact = answer.exact || decidedExactly || tied;
  answer.parallel = parallel;
  if (parallel) ends.moveToMiddle(answer);
  return answer;
}

}  // namespace

Vector3d normalOfCrossing(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                          const Vector3d& q1) {
  const Vector3d normal = unitCross(p0, p1, q0, q1);
  if (normal != Vector3d::Zero()) return normal;
  // Quartered, so that the extents of the largest doubles stay finite.
  return axisOfLeast((0.25 * p1 - 0.25 * p0).cwiseAbs() + (0.25 * q1 - 0.25 * q0).cwiseAbs());
}

std::optional<EdgeEdgeDistance> crossingEdgesDistance(const Vector3d& p0, const Vector3d& p1,
                                                      const Vector3d& q0, const Vector3d& q1) {
  const EdgePair edges(p0, p1, q0, q1);
  const CrossingDecision decision = crossingOf(edges);
  if (decision.crossing != Crossing::Interior) return {};
  return interiorDistance(edges, decision.exact);
}

EdgeEdgeDistance finiteEdgeEdgeDistance(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                                        const Vector3d& q1) {
  const EdgePair edges(p0, p1, q0, q1);
  const CrossingDecision decision = crossingOf(edges);
  if (decision.crossing == Crossing::Interior) return interiorDistance(edges, decision.exact);
  return endDistance(edges, decision.crossing == Crossing::Parallel, decision.exact);
}

EdgeEdgeDistance edgeEdgeDistance(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                                  const Vector3d& q1) {
  const StandardFloatingPoint standard;
  if (areFinite(p0, p1, q0, q1)) return finiteEdgeEdgeDistance(p0, p1, q0, q1);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Vector3d none = Vector3d::Constant(nan);
  return {nan, nan, none, none, nan, EdgeFeature::Start, EdgeFeature::Start, false, false};
}

}  // namespace palpate
