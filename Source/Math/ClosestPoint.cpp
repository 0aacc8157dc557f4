#include "Math/ClosestPoint.h"

#include "Math/Compensated.h"
#include "Math/ExactClosestPoint.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Sums in one order whatever Eigen would choose.
double dot(const Vector3d& a, const Vector3d& b) {
  return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}
double sumOfMagnitudes(const Vector3d& a) {
  return (std::abs(a[0]) + std::abs(a[1])) + std::abs(a[2]);
}
double largest(const Vector3d& a) {
  return std::max({std::abs(a[0]), std::abs(a[1]), std::abs(a[2])});
}

enum class Sign { NotPositive, Positive, Unknown };

Sign signOf(double value, double error) {
  if (value > error) return Sign::Positive;
  if (value < -error) return Sign::NotPositive;
  return Sign::Unknown;  // NaN too
}

/// Sign of u . v of differences that were rounded once.
Sign signAlong(const Vector3d& u, const Vector3d& v) {
  const double magnitude = (std::abs(u[0] * v[0]) + std::abs(u[1] * v[1])) + std::abs(u[2] * v[2]);
  if (!(magnitude < kOverflowGuard)) return Sign::Unknown;
  const Sign sign = signOf(dot(u, v), kDotError * magnitude + kUnderflowGuard);
  if (sign != Sign::Unknown) return sign;
  // Perpendicular axis by axis, as edges of boxes are: a product with zero has no error.
  for (int i = 0; i < 3; ++i)
    if (u[i] != 0.0 && v[i] != 0.0) return Sign::Unknown;
  return Sign::NotPositive;
}

/// Sign of (edge x from) . normal. magnitude: product of the sums of magnitudes of the normal's two
/// factors.
Sign signAside(const Vector3d& edge, const Vector3d& from, const Vector3d& normal,
               double magnitude) {
  const double own = sumOfMagnitudes(edge) * sumOfMagnitudes(from);
  if (!(own < kSquareOverflowGuard && magnitude < kSquareOverflowGuard)) return Sign::Unknown;
  const double error = kTripleError * own * magnitude + (1.0 + own + magnitude) * kUnderflowGuard;
  return signOf(dot(edge.cross(from), normal), error);
}

using CornerPointers = std::array<const Vector3d*, 3>;

struct FeatureDecision {
  TriangleFeature feature;
  bool exact;
};

FeatureDecision closestFeature(const Vector3d& p, const CornerPointers& corners) {
  std::array<Vector3d, 3> edge, from;
  for (int i = 0; i < 3; ++i) {
    edge[i] = *corners[(i + 1) % 3] - *corners[i];
    from[i] = p - *corners[i];
  }
  const auto exactly = [&] {
    return FeatureDecision{exact::closestFeature(p, *corners[0], *corners[1], *corners[2]), true};
  };
  const Vector3d normal = edge[0].cross(edge[1]);
  const double magnitude = sumOfMagnitudes(edge[0]) * sumOfMagnitudes(edge[1]);
  bool inside = true;
  for (int i = 0; i < 3; ++i) {
    const Sign side = signAside(edge[i], from[i], normal, magnitude);
    if (side == Sign::Positive) continue;
    inside = false;
    const Sign start = signAlong(from[i], edge[i]);
    const Sign end = signAlong(from[(i + 1) % 3], -edge[i]);
    if (start == Sign::NotPositive || end == Sign::NotPositive) continue;
    if (side == Sign::Unknown || start == Sign::Unknown || end == Sign::Unknown) return exactly();
    return {static_cast<TriangleFeature>(3 + i), false};
  }
  if (inside) return {TriangleFeature::Face, false};
  for (int i = 0; i < 3; ++i) {
    if (signAlong(from[i], edge[i]) == Sign::NotPositive &&
        signAlong(from[i], -edge[(i + 2) % 3]) == Sign::NotPositive)
      return {static_cast<TriangleFeature>(i), false};
  }
  return exactly();
}

/// A weight as a coarse part, a multiple of 2^-26, and the little that is missing.
struct Weight {
  double coarse, fine;
};

double toCoarse(double value) { return (value + kCoarseWeight) - kCoarseWeight; }
/// To the nearest multiple of 2^-53, |value| below 1/4; turns with the value's sign.
double toGrid(double value) { return (value + 0.75) - 0.75; }

/// In [0, 1], multiples of 2^-53.
double unitWeight(const Weight& weight) {
  return std::clamp(weight.coarse + toGrid(weight.fine), 0.0, 1.0);
}
/// From [-1, 1] to the same; -w gives 1 minus what w gives.
double halvedWeight(const Weight& weight) {
  return std::clamp(0.5 * (1.0 + weight.coarse) + toGrid(0.5 * weight.fine), 0.0, 1.0);
}

bool isModerate(double extent) { return extent > kSmallestModerate && extent < kLargestModerate; }

/// p seen from a.
Foot footOnPoint(const Vector3d& p, const Vector3d& a) {
  const Vector3d difference = p - a;
  const double extent = largest(difference);
  if (extent == 0.0) return {difference, Vector3d::Zero(), 0.0, 0.0, 0.0, false};
  if (!isModerate(extent)) return exact::footOnPoint(p, a);
  const double distance = std::sqrt(dot(difference, difference));
  return {difference, difference / distance, distance, 0.0, 0.0, false};
}

/// Twice the vector from the middle of b to the middle of a; the same bits whichever end comes
/// first.
Difference betweenMiddles(const Vector3d& a0, const Vector3d& a1, const Vector3d& b0,
                          const Vector3d& b1) {
  return sum(difference(a0, -a1), difference(-b0, b1));
}

/// p seen from the inside of edge ab: one Newton step from a coarse weight, whose residual is
/// compensated.
Foot footOnLine(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Difference middle = betweenMiddles(p, p, a, b), edge = difference(b, a);
  const double extent = std::max(0.5 * largest(middle.high), largest(edge.high));
  if (!isModerate(extent)) return exact::footOnLine(p, a, b);
  const double square = dot(edge.high, edge.high);
  Weight weight;
  weight.coarse = toCoarse(std::clamp(dot(middle.high, edge.high) / square, -1.0, 1.0));
  const Vector3d residual = combination(middle, -weight.coarse, edge);
  weight.fine = dot(residual, edge.high) / square;
  const Vector3d doubled = residual - weight.fine * edge.high;
  // NaN, of an edge too short to square, goes the exact way too.
  if (!(std::abs(weight.fine) < kFineWeight && largest(doubled) > kTouching * extent))
    return exact::footOnLine(p, a, b);
  const double length = std::sqrt(dot(doubled, doubled));
  return {0.5 * doubled, doubled / length, 0.5 * length, halvedWeight(weight), 0.0, false};
}

/// The foot of the perpendicular from the origin to the plane m + s u + t v, if floating point can
/// tell it.
struct PlaneFoot {
  Weight s, t;
  Vector3d normal;  ///< unit, along u x v
  double height;    ///< along it
};

/// The same bits, mapped, when (u, s) and (v, t) change places.
bool findFootOnPlane(const Difference& m, const Difference& u, const Difference& v, double extent,
                     PlaneFoot& foot) {
  const double square = dot(u.high, u.high) * dot(v.high, v.high);
  Vector3d normal = u.high.cross(v.high);
  double normalSquare = dot(normal, normal);
  bool accurate = false;
  const auto makeAccurate = [&] {
    normal = accurateCross(u, v);
    normalSquare = dot(normal, normal);
    accurate = true;
  };
  if (!(normalSquare > kNarrowAngleSquare * square)) makeAccurate();
  if (!(normalSquare > kSliverAngleSquare * square)) return false;

  const auto sOf = [&](const Vector3d& from) {
    return -dot(from.cross(v.high), normal) / normalSquare;
  };
  const auto tOf = [&](const Vector3d& from) {
    return -dot(u.high.cross(from), normal) / normalSquare;
  };
  foot.s.coarse = toCoarse(std::clamp(sOf(m.high), -1.0, 1.0));
  foot.t.coarse = toCoarse(std::clamp(tOf(m.high), -1.0, 1.0));
  const Vector3d residual = combination(m, foot.s.coarse, u, foot.t.coarse, v);

  double length = std::sqrt(normalSquare);
  foot.height = dot(normal, residual) / length;
  const double factors = std::sqrt(square);
  if (!accurate &&
      !(std::abs(foot.height) * (5.0 * factors + 4.0 * length) < 7.0 * extent * length)) {
    makeAccurate();
    length = std::sqrt(normalSquare);
    foot.height = dot(normal, residual) / length;
  }
  const Vector3d tangential = residual - normal * (dot(normal, residual) / normalSquare);
  foot.s.fine = sOf(tangential);
  foot.t.fine = tOf(tangential);
  foot.normal = normal / length;
  const bool converged = std::abs(foot.s.fine) < kFineWeight && std::abs(foot.t.fine) < kFineWeight;
  return converged && std::abs(foot.height) > kTouching * extent;
}

/// The corner opposite the longest edge: the two shortest edges meet there. Equals are told apart
/// by distance from p, then by coordinates, never by their order.
int widestCorner(const Vector3d& p, const CornerPointers& corners) {
  const auto rank = [&](int i) {
    const Vector3d& at = *corners[i];
    const Vector3d opposite = *corners[(i + 1) % 3] - *corners[(i + 2) % 3], from = p - at;
    return std::tuple(dot(opposite, opposite), dot(from, from), at[0], at[1], at[2]);
  };
  const auto first = rank(0), second = rank(1), third = rank(2);
  if (first >= second && first >= third) return 0;
  return second >= third ? 1 : 2;
}

/// p seen from the inside of the face. weights: of the corners, summing to 1.
Foot footOnFace(const Vector3d& p, const CornerPointers& corners, Vector3d& weights) {
  const int i = widestCorner(p, corners), j = (i + 1) % 3, k = (i + 2) % 3;
  const Vector3d &a = *corners[i], &b = *corners[j], &c = *corners[k];
  const Difference m = difference(p, a), u = difference(a, b), v = difference(a, c);
  const double extent = std::max({largest(m.high), largest(u.high), largest(v.high)});
  PlaneFoot plane;
  Foot foot;
  if (isModerate(extent) && findFootOnPlane(m, u, v, extent, plane)) {
    const Vector3d direction = plane.height < 0.0 ? Vector3d(-plane.normal) : plane.normal;
    const double distance = std::abs(plane.height);
    foot = {distance * direction, direction,           distance,
            unitWeight(plane.s),  unitWeight(plane.t), false};
  } else {
    foot = exact::footOnPlane(p, a, b, c);
  }
  // Rounding may push the sum past 1 by 2^-53.
  const double excess = std::max(0.0, foot.s + foot.t - 1.0);
  (foot.s > foot.t ? foot.s : foot.t) -= excess;
  weights[j] = foot.s;
  weights[k] = foot.t;
  weights[i] = (1.0 - foot.s) - foot.t;
  return foot;
}

/// Unit vector along (b - a) x (d - c), zero where that is.
Vector3d unitCross(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const Difference u = difference(b, a), v = difference(d, c);
  const Vector3d normal = accurateCross(u, v);
  const double square = dot(normal, normal), factors = dot(u.high, u.high) * dot(v.high, v.high);
  if (isModerate(largest(u.high)) && isModerate(largest(v.high)) &&
      square > kSliverAngleSquare * factors)
    return normal / std::sqrt(square);
  return exact::unitCross(a, b, c, d);
}

Vector3d axisOfLeast(const Vector3d& extents) {
  int axis;
  extents.minCoeff(&axis);  // the first of equals
  return Vector3d::Unit(axis);
}

Vector3d windingNormal(const Vector3d& p, const CornerPointers& corners) {
  const int i = widestCorner(p, corners);
  const Vector3d &a = *corners[i], &b = *corners[(i + 1) % 3], &c = *corners[(i + 2) % 3];
  const Vector3d normal = unitCross(a, b, a, c);
  if (normal != Vector3d::Zero()) return normal;
  // Halved, so that the extent of the largest doubles stays finite.
  return axisOfLeast(0.5 * a.cwiseMax(b).cwiseMax(c) - 0.5 * a.cwiseMin(b).cwiseMin(c));
}

Vector3d crossingNormal(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                        const Vector3d& q1) {
  const Vector3d normal = unitCross(p0, p1, q0, q1);
  if (normal != Vector3d::Zero()) return normal;
  return axisOfLeast((0.25 * p1 - 0.25 * p0).cwiseAbs() + (0.25 * q1 - 0.25 * q0).cwiseAbs());
}

}  // namespace

TriangleFeature closestTriangleFeature(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                                       const Vector3d& c) {
  return closestFeature(p, {&a, &b, &c}).feature;
}

bool hasArea(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return unitCross(a, b, a, c) != Vector3d::Zero();
}

bool comesNearer(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Sign sign = signAlong(p - a, b - a);
  return sign == Sign::Unknown ? exact::along(p, a, b) > 0 : sign == Sign::Positive;
}

bool liesInwards(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a;
  const Sign sign = signAside(ab, p - a, ab.cross(ac), sumOfMagnitudes(ab) * sumOfMagnitudes(ac));
  return sign == Sign::Unknown ? exact::side(p, a, b, c) > 0 : sign == Sign::Positive;
}

VertexTriangleDistance finiteVertexTriangleDistance(const Vector3d& p, const Vector3d& a,
                                                    const Vector3d& b, const Vector3d& c) {
  const CornerPointers corners{&a, &b, &c};
  const FeatureDecision decision = closestFeature(p, corners);
  const int feature = static_cast<int>(decision.feature);
  Vector3d weights = Vector3d::Zero();
  Foot foot;
  if (feature < 3) {
    foot = footOnPoint(p, *corners[feature]);
    weights[feature] = 1.0;
  } else if (feature < 6) {
    const int i = feature - 3, j = (i + 1) % 3;
    foot = footOnLine(p, *corners[i], *corners[j]);
    weights[i] = 1.0 - foot.s;
    weights[j] = foot.s;
  } else {
    foot = footOnFace(p, corners, weights);
  }
  const Vector3d normal = foot.distance == 0.0 ? windingNormal(p, corners) : foot.direction;
  return {weights,       foot.difference,  normal,
          foot.distance, decision.feature, decision.exact || foot.exact};
}

namespace {

/// Whether u and v are parallel, told from products that are exact; false where they are not.
bool areParallel(const Difference& u, const Difference& v) {
  if (u.low != Vector3d::Zero() || v.low != Vector3d::Zero()) return false;
  const auto isExact = [](double product, double x, double y) {
    return x == 0.0 || y == 0.0 || std::abs(product) > kUnderflowGuardOfProducts;
  };
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const auto [plus, minus] = minorOf(u.high, v.high, i);
    if (!isExact(plus.value, u.high[j], v.high[k]) || !isExact(minus.value, u.high[k], v.high[j]))
      return false;
    if (plus.value != minus.value || plus.error != minus.error) return false;
  }
  return true;
}

/// Two edges as the plane m + s u + t v, s and t in [-1, 1], of twice the differences between their
/// points.
struct EdgePair {
  Difference m, u, v;

  EdgePair(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0, const Vector3d& q1)
      : m(betweenMiddles(p0, p1, q0, q1)), u(difference(p1, p0)), v(difference(q0, q1)) {}
};

/// None: left to exact arithmetic.
std::optional<Crossing> crossing(const EdgePair& edges) {
  const Vector3d &m = edges.m.high, &u = edges.u.high, &v = edges.v.high;
  const double uSum = sumOfMagnitudes(u), vSum = sumOfMagnitudes(v), magnitude = uSum * vSum;
  // m was rounded in terms as large as the edges at least.
  const double mSum = sumOfMagnitudes(m) + uSum + vSum;
  if (!(mSum < kLargestModerate)) return {};
  const Vector3d normal = u.cross(v);
  const double square = dot(normal, normal), squareError = kTripleError * magnitude * magnitude;
  const double s = std::abs(dot(m.cross(v), normal)), t = std::abs(dot(u.cross(m), normal));
  const double sError =
      kTripleError * mSum * vSum * magnitude + squareError + kUnderflowGuardOfProducts;
  const double tError =
      kTripleError * mSum * uSum * magnitude + squareError + kUnderflowGuardOfProducts;
  if (s - square > sError || t - square > tError) return Crossing::Outside;
  if (square - s > sError && square - t > tError) return Crossing::Interior;
  if (areParallel(edges.u, edges.v)) return Crossing::Parallel;
  return {};
}

EdgeEdgeDistance interiorDistance(const EdgePair& edges, bool decidedExactly, const Vector3d& p0,
                                  const Vector3d& p1, const Vector3d& q0, const Vector3d& q1) {
  const double extent =
      std::max({0.5 * largest(edges.m.high), largest(edges.u.high), largest(edges.v.high)});
  PlaneFoot plane;
  EdgeEdgeDistance result{};
  if (isModerate(extent) && findFootOnPlane(edges.m, edges.u, edges.v, extent, plane)) {
    result.normal = plane.height < 0.0 ? Vector3d(-plane.normal) : plane.normal;
    result.distance = 0.5 * std::abs(plane.height);
    result.difference = result.distance * result.normal;
    result.weightA = halvedWeight(plane.s);
    result.weightB = halvedWeight(plane.t);
    result.exact = decidedExactly;
  } else {
    const Foot foot = exact::footBetweenLines(p0, p1, q0, q1);
    result.normal = foot.distance == 0.0 ? crossingNormal(p0, p1, q0, q1) : foot.direction;
    result.distance = foot.distance;
    result.difference = foot.difference;
    result.weightA = foot.s;
    result.weightB = foot.t;
    result.exact = true;
  }
  result.featureA = result.featureB = EdgeFeature::Interior;
  return result;
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

/// The closest points of edges of which at least one is met at an end.
EdgeEdgeDistance endDistance(bool parallel, bool decidedExactly, const Vector3d& p0,
                             const Vector3d& p1, const Vector3d& q0, const Vector3d& q1) {
  const std::array<EndFoot, 4> ends{footOfEnd(p0, q0, q1), footOfEnd(p1, q0, q1),
                                    footOfEnd(q0, p0, p1), footOfEnd(q1, p0, p1)};
  const auto weightA = [&](int i) { return i < 2 ? static_cast<double>(i) : ends[i].foot.s; };
  const auto weightB = [&](int i) { return i < 2 ? ends[i].foot.s : static_cast<double>(i - 2); };
  int nearest = 0;
  for (int i = 1; i < 4; ++i)
    if (ends[i].foot.distance < ends[nearest].foot.distance) nearest = i;
  for (int i = 0; i < 4; ++i) {
    const bool samePair = weightA(i) == weightA(nearest) && weightB(i) == weightB(nearest);
    if (samePair || parallel || ends[i].foot.distance > kTie * ends[nearest].foot.distance)
      continue;
    nearest = exact::nearestEnd(p0, p1, q0, q1);
    decidedExactly = true;
    break;
  }
  const EndFoot& end = ends[nearest];
  const double turn = nearest < 2 ? 1.0 : -1.0;
  EdgeEdgeDistance result{};
  result.difference = turn * end.foot.difference;
  result.normal =
      end.foot.distance == 0.0 ? crossingNormal(p0, p1, q0, q1) : turn * end.foot.direction;
  result.distance = end.foot.distance;
  result.weightA = weightA(nearest);
  result.weightB = weightB(nearest);
  result.featureA = nearest < 2 ? static_cast<EdgeFeature>(nearest) : end.feature;
  result.featureB = nearest < 2 ? end.feature : static_cast<EdgeFeature>(nearest - 2);
  result.parallel = parallel;
  result.exact = decidedExactly || end.foot.exact;
  if (!parallel) return result;

  // The stretch that two parallel edges share runs from end to end; its middle is the answer.
  const std::array<bool, 4> beside{isBeside(p0, q0, q1), isBeside(p1, q0, q1), isBeside(q0, p0, p1),
                                   isBeside(q1, p0, p1)};
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
  if (low < 0 || low == high) return result;
  result.weightA = 0.5 * weightA(low) + 0.5 * weightA(high);
  result.weightB = 0.5 * weightB(low) + 0.5 * weightB(high);
  result.featureA = featureAt(result.weightA);
  result.featureB = featureAt(result.weightB);
  return result;
}

}  // namespace

std::optional<EdgeEdgeDistance> crossingEdgesDistance(const Vector3d& p0, const Vector3d& p1,
                                                      const Vector3d& q0, const Vector3d& q1) {
  const EdgePair edges(p0, p1, q0, q1);
  const std::optional<Crossing> decision = crossing(edges);
  const Crossing how = decision ? *decision : exact::crossing(p0, p1, q0, q1);
  if (how != Crossing::Interior) return {};
  return interiorDistance(edges, !decision, p0, p1, q0, q1);
}

EdgeEdgeDistance finiteEdgeEdgeDistance(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                                        const Vector3d& q1) {
  const EdgePair edges(p0, p1, q0, q1);
  const std::optional<Crossing> decision = crossing(edges);
  const Crossing how = decision ? *decision : exact::crossing(p0, p1, q0, q1);
  if (how == Crossing::Interior) return interiorDistance(edges, !decision, p0, p1, q0, q1);
  return endDistance(how == Crossing::Parallel, !decision, p0, p1, q0, q1);
}

namespace {

bool areFinite(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const Vector3d zeros = 0.0 * a + 0.0 * b + 0.0 * c + 0.0 * d;  // NaN where anything is not finite
  return zeros == Vector3d::Zero();
}

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace

VertexTriangleDistance vertexTriangleDistance(const Vector3d& p, const Vector3d& a,
                                              const Vector3d& b, const Vector3d& c) {
  if (areFinite(p, a, b, c)) return finiteVertexTriangleDistance(p, a, b, c);
  const Vector3d none = Vector3d::Constant(kNaN);
  return {none, none, none, kNaN, TriangleFeature::CornerA, false};
}

EdgeEdgeDistance edgeEdgeDistance(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                                  const Vector3d& q1) {
  if (areFinite(p0, p1, q0, q1)) return finiteEdgeEdgeDistance(p0, p1, q0, q1);
  const Vector3d none = Vector3d::Constant(kNaN);
  return {kNaN, kNaN, none, none, kNaN, EdgeFeature::Start, EdgeFeature::Start, false, false};
}

}  // namespace palpate
