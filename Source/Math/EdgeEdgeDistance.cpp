// Part of Math/ClosestPoint.h: the distance of two edges.
#include "Math/ClosestPoint.h"
#include "Math/ExactClosestPoint.h"
#include "Math/Foot.h"
#include "Math/Tolerances.h"
#include "Exact/FilteredSigns.h"
#include "Core/FloatingPoint.h"

#include <algorithm>
#include <array>
#include <cmath>
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
  CrossingPlace crossing;
  bool exact;
};

/// Whether products prove that u x v is zero. The two products of each component must be equal,
/// including their rounding errors, or each must have a factor zero. Edges must be below
/// kLargestModerate.
bool areCertainlyParallel(const Difference& u, const Difference& v) {
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const bool isZero = u.high[j] == 0.0 || v.high[k] == 0.0;
    if (isZero != (u.high[k] == 0.0 || v.high[j] == 0.0)) return false;
    if (isZero) continue;
    if (u.low[j] != 0.0 || v.low[k] != 0.0 || u.low[k] != 0.0 || v.low[j] != 0.0) return false;
    const RoundedWithError plus = exactProduct(u.high[j], v.high[k]),
                           minus = exactProduct(u.high[k], v.high[j]);
    if (plus.value != minus.value || plus.error != minus.error ||
        !(std::abs(plus.value) > kUnderflowGuardOfProducts))
      return false;
  }
  return true;
}

/// The components of a vector that are not zero, as bits.
unsigned nonzeroOf(const Vector3d& a) {
  return static_cast<unsigned>(a[0] != 0.0) | static_cast<unsigned>(a[1] != 0.0) << 1 |
         static_cast<unsigned>(a[2] != 0.0) << 2;
}
/// The components of a cross product that may differ from zero. Those of the factors are given.
unsigned nonzeroOfCross(unsigned a, unsigned b) {
  // Component i is from components i + 1 and i + 2 of the factors.
  const unsigned aNext = a >> 1 | a << 2, aLast = a >> 2 | a << 1, bNext = b >> 1 | b << 2,
                 bLast = b >> 2 | b << 1;
  return ((aNext & bLast) | (aLast & bNext)) & 7;
}

/// Whether products with a factor zero prove that the closest points of two lines, which are not
/// parallel, are not both inside the edges: one is an end. This decides where features of meshes
/// with edges along the axes, or in planes along them, are opposite each other.
bool isCertainlyAtEnd(const EdgePair& edges) {
  const unsigned u = nonzeroOf(edges.p1 - edges.p0), v = nonzeroOf(edges.q1 - edges.q0);
  const unsigned normal = nonzeroOfCross(u, v);
  for (const Vector3d* p : {&edges.p0, &edges.p1})
    for (const Vector3d* q : {&edges.q0, &edges.q1}) {
      // The closest point of line p is this end if (w x v) . (u x v) is zero.
      const unsigned w = nonzeroOf(*p - *q);
      if ((nonzeroOfCross(w, v) & normal) == 0 || (nonzeroOfCross(w, u) & normal) == 0) return true;
    }
  return false;
}

/// The terms that decide whether two lines are closest inside both edges: they are if `square` is
/// more than s and t. Each term is off by its error at most.
struct CrossingTerms {
  double square, squareError, s, sError, t, tError;

  std::optional<CrossingPlace> decision() const {
    if (s - square > sError + squareError || t - square > tError + squareError)
      return CrossingPlace::Outside;
    if (square - s > sError + squareError && square - t > tError + squareError)
      return CrossingPlace::Interior;
    return {};
  }
};

/// The terms in plain floating point. m was rounded from terms at least as large as the edges,
/// which mSum includes.
CrossingTerms roundedTerms(const EdgePair& edges, double mSum, double uSum, double vSum) {
  const Vector3d &m = edges.m.high, &u = edges.u.high, &v = edges.v.high;
  const double magnitude = uSum * vSum;
  const Vector3d normal = u.cross(v);
  return {dot(normal, normal),
          kTripleError * magnitude * magnitude + kUnderflowGuardOfProducts,
          std::abs(dot(m.cross(v), normal)),
          kTripleError * mSum * vSum * magnitude,
          std::abs(dot(u.cross(m), normal)),
          kTripleError * mSum * uSum * magnitude};
}

/// The terms for nearly parallel edges, whose plain normal is only rounding. A cross product's sum
/// of magnitudes has two errors: kAccurateCrossError relative to itself, and kAccurateCrossLoss
/// relative to that of its factors. The terms of a scalar product have the errors of both its
/// factors, and its own rounding.
CrossingTerms compensatedTerms(const EdgePair& edges, double mSum, double uSum, double vSum) {
  const Vector3d normal = accurateCross(edges.u, edges.v);
  const Vector3d crossForS = accurateCross(edges.m, edges.v),
                 crossForT = accurateCross(edges.u, edges.m);
  const double normalSum = sumOfMagnitudes(normal), factors = uSum * vSum;
  const auto errorWith = [&](const Vector3d& other, double otherFactors) {
    const double otherSum = sumOfMagnitudes(other);
    return 4 * kAccurateCrossError * normalSum * otherSum +
           kAccurateCrossLoss * (factors * otherSum + otherFactors * normalSum) +
           kAccurateCrossLoss * kAccurateCrossLoss * factors * otherFactors;
  };
  return {dot(normal, normal),
          errorWith(normal, factors) + kUnderflowGuardOfProducts,
          std::abs(dot(crossForS, normal)),
          errorWith(crossForS, mSum * vSum),
          std::abs(dot(crossForT, normal)),
          errorWith(crossForT, mSum * uSum)};
}

CrossingDecision crossingOf(const EdgePair& edges) {
  const auto& [p0, p1, q0, q1, m, u, v] = edges;
  const double uSum = sumOfMagnitudes(u.high), vSum = sumOfMagnitudes(v.high);
  const double mSum = sumOfMagnitudes(m.high) + uSum + vSum;
  if (mSum < kLargestModerate) {
    const CrossingTerms rounded = roundedTerms(edges, mSum, uSum, vSum);
    if (const auto decision = rounded.decision()) return {*decision, false};
    if (rounded.square > rounded.squareError && isCertainlyAtEnd(edges))
      return {CrossingPlace::Outside, false};
    if (areCertainlyParallel(difference(p1, p0), difference(q1, q0)))
      return {CrossingPlace::Parallel, false};
    // The error of m is relative to the positions, which may be far from the origin.
    const double positionSum = mSum + sumOfMagnitudes(p0) + sumOfMagnitudes(p1) +
                               sumOfMagnitudes(q0) + sumOfMagnitudes(q1);
    if (std::min(uSum, vSum) > kSmallestModerate && positionSum < kLargestModerate)
      if (const auto decision = compensatedTerms(edges, positionSum, uSum, vSum).decision())
        return {*decision, false};
  }
  return {exact::crossing(p0, p1, q0, q1), true};
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

/// The foot of one edge's end on the other edge.
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

/// Whether p's foot is on edge ab, not beyond one of its ends.
bool isBeside(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const auto isBefore = [&p](const Vector3d& from, const Vector3d& to) {
    const Vector3d edge = to - from, beyond = from - p;
    if (signAlong(edge, -beyond) == Sign::Positive) return false;
    return signAlong(edge, beyond) == Sign::Positive || exact::along(p, from, to) < 0;
  };
  return a != b && !isBefore(a, b) && !isBefore(b, a);
}

/// The mean of two weights, rounded to a multiple of 2^-53 as they are. One less the weights gives
/// one less the mean.
double middleOf(double v, double w) {
  const double middle = 0.5 * v + 0.5 * w;
  return middle < 0.5 ? (middle + 0.5) - 0.5 : middle;
}

EdgeFeature featureAt(double weight) {
  if (weight == 0.0) return EdgeFeature::Start;
  return weight == 1.0 ? EdgeFeature::End : EdgeFeature::Interior;
}

/// The feet of the four ends, each on the other edge: p0, p1, q0, q1.
class EndFeet {
 public:
  explicit EndFeet(const EdgePair& edges)
      : m_edges(edges),
        m_ends{footOfEnd(edges.p0, edges.q0, edges.q1), footOfEnd(edges.p1, edges.q0, edges.q1),
               footOfEnd(edges.q0, edges.p0, edges.p1), footOfEnd(edges.q1, edges.p0, edges.p1)} {}

  double weightA(int i) const { return i < 2 ? static_cast<double>(i) : m_ends[i].foot.s; }
  double weightB(int i) const { return i < 2 ? m_ends[i].foot.s : static_cast<double>(i - 2); }
  std::array<EdgeFeature, 2> features(int i) const {
    const EdgeFeature own = static_cast<EdgeFeature>(i % 2), other = m_ends[i].feature;
    return i < 2 ? std::array{own, other} : std::array{other, own};
  }

  /// The index of the nearest end. tied: set if another pair of points is equally near, within
  /// rounding. Pairs are compared by their features, because the weight of a point inside an edge
  /// may round to that of an end.
  int nearest(bool& tied) const {
    int nearest = 0;
    for (int i = 1; i < 4; ++i)
      if (distance(i) < distance(nearest)) nearest = i;
    for (int i = 0; i < 4; ++i) {
      const bool samePair = features(i) == features(nearest);
      tied = tied || (!samePair && distance(i) <= kTie * distance(nearest));
    }
    return nearest;
  }

  /// Whether the nearest end is also an end of the other edge. No end before it is then equally
  /// near, and it is of p: the distance of an end on the other edge is always computed as 0.
  bool isCommon(int i) const {
    const auto& [p0, p1, q0, q1, m, u, v] = m_edges;
    const Vector3d& end = i == 0 ? p0 : p1;
    return i < 2 && (end == q0 || end == q1);
  }

  EdgeEdgeDistance answer(int i) const {
    const Foot& foot = m_ends[i].foot;
    const auto [featureA, featureB] = features(i);
    const double turn = i < 2 ? 1.0 : -1.0;
    const Vector3d normal =
        foot.distance == 0.0 ? crossingNormal(m_edges) : Vector3d(turn * foot.direction);
    return {weightA(i), weightB(i),    turn * foot.difference,
            normal,     foot.distance, featureA,
            featureB,   false,         foot.exact};
  }

  /// Whether the foot of each end is on the other edge. Parallel edges share the interval between
  /// such ends, which are all equally near.
  std::array<bool, 4> beside() const {
    const auto& [p0, p1, q0, q1, m, u, v] = m_edges;
    return {isBeside(p0, q0, q1), isBeside(p1, q0, q1), isBeside(q0, p0, p1), isBeside(q1, p0, p1)};
  }

  /// The index of the nearest of the chosen ends.
  int nearestOf(const std::array<bool, 4>& chosen) const {
    int nearest = -1;
    for (int i = 0; i < 4; ++i)
      if (chosen[i] && (nearest < 0 || distance(i) < distance(nearest))) nearest = i;
    return nearest;
  }

  /// Ends beside the other edge are equally near, but rounding may make their vectors differ. The
  /// mean of these does not depend on the order of the edges and of their ends.
  void takeMean(EdgeEdgeDistance& answer, const std::array<bool, 4>& beside) const {
    std::array<Vector3d, 4> differences, directions;
    int count = 0;
    bool equal = true;
    for (int i = 0; i < 4; ++i) {
      const double turn = !beside[i] ? 0.0 : i < 2 ? 1.0 : -1.0;
      differences[i] = turn * m_ends[i].foot.difference;
      directions[i] = turn * m_ends[i].foot.direction;
      count += beside[i];
      equal = equal && (!beside[i] || differences[i] == answer.difference);
    }
    if (equal) return;
    // Quartered, so that the largest differences stay finite. Pairs first, so that no order of the
    // edges and of their ends changes the sum.
    const auto sum = [](const std::array<Vector3d, 4>& of) -> Vector3d {
      return (0.25 * of[0] + 0.25 * of[1]) + (0.25 * of[2] + 0.25 * of[3]);
    };
    answer.difference = sum(differences) * (4.0 / count);
    const Vector3d direction = sum(directions);
    answer.normal = direction / std::sqrt(dot(direction, direction));
  }

  /// Moves the closest points of parallel edges to the middle of the interval that the edges share,
  /// which runs from one end to another.
  void moveToMiddle(EdgeEdgeDistance& answer, const std::array<bool, 4>& beside) const {
    // Both weights are compared: if one edge has no length, the weights on the other are equal.
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
    answer.weightA = middleOf(weightA(low), weightA(high));
    answer.weightB = middleOf(weightB(low), weightB(high));
    answer.featureA = featureAt(answer.weightA);
    answer.featureB = featureAt(answer.weightB);
  }

 private:
  double distance(int i) const { return m_ends[i].foot.distance; }

  const EdgePair& m_edges;
  std::array<EndFoot, 4> m_ends;
};

/// Whether edge p comes before edge q: by the lower end, then by the higher end, each compared by
/// x, then y, then z. Equal edges do not precede each other.
bool precedes(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0, const Vector3d& q1) {
  using Point = std::array<double, 3>;
  const auto ends = [](const Vector3d& start, const Vector3d& end) {
    const Point s{start[0], start[1], start[2]}, e{end[0], end[1], end[2]};
    return std::pair(std::min(s, e), std::max(s, e));
  };
  return ends(p0, p1) < ends(q0, q1);
}

/// The closest points of edges, where at least one point is an end.
EdgeEdgeDistance endDistance(const EdgePair& edges, bool parallel, bool decidedExactly) {
  const EndFeet ends(edges);
  bool tied = false;
  int nearest = ends.nearest(tied);
  const std::array<bool, 4> beside = parallel ? ends.beside() : std::array<bool, 4>{};
  // For parallel edges, any pair within the shared interval will do, but no other.
  if (const int among = ends.nearestOf(beside); among >= 0) nearest = among;
  tied = tied && !beside[nearest] && !ends.isCommon(nearest);
  if (tied) nearest = exact::nearestEnd(edges.p0, edges.p1, edges.q0, edges.q1);
  EdgeEdgeDistance answer = ends.answer(nearest);
  answer.exact = answer.exact || decidedExactly || tied;
  answer.parallel = parallel;
  if (!parallel) return answer;
  if (answer.distance > 0.0)
    ends.takeMean(answer, beside);
  else if (precedes(edges.q0, edges.q1, edges.p0, edges.p1))
    answer.normal = -answer.normal;
  ends.moveToMiddle(answer, beside);
  return answer;
}

}  // namespace

Vector3d normalOfCrossing(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                          const Vector3d& q1) {
  const Vector3d normal = unitCross(p0, p1, q0, q1);
  if (normal != Vector3d::Zero()) return normal;
  // Quartered, so that the extents of the largest doubles stay finite.
  return axisOfLeastComponent((0.25 * p1 - 0.25 * p0).cwiseAbs() +
                              (0.25 * q1 - 0.25 * q0).cwiseAbs());
}

std::optional<EdgeEdgeDistance> crossingEdgesDistance(const Vector3d& p0, const Vector3d& p1,
                                                      const Vector3d& q0, const Vector3d& q1) {
  const EdgePair edges(p0, p1, q0, q1);
  const CrossingDecision decision = crossingOf(edges);
  if (decision.crossing != CrossingPlace::Interior) return {};
  return interiorDistance(edges, decision.exact);
}

EdgeEdgeDistance finiteEdgeEdgeDistance(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                                        const Vector3d& q1) {
  const EdgePair edges(p0, p1, q0, q1);
  const CrossingDecision decision = crossingOf(edges);
  if (decision.crossing == CrossingPlace::Interior) return interiorDistance(edges, decision.exact);
  return endDistance(edges, decision.crossing == CrossingPlace::Parallel, decision.exact);
}

EdgeEdgeDistance edgeEdgeDistance(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                                  const Vector3d& q1) {
  const StandardFloatingPoint standard;
  if (areFinite(p0, p1, q0, q1)) return standard.evaluated(finiteEdgeEdgeDistance(p0, p1, q0, q1));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Vector3d none = Vector3d::Constant(nan);
  return {nan, nan, none, none, nan, EdgeFeature::Start, EdgeFeature::Start, false, false};
}

}  // namespace palpate
