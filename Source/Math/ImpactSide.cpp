// Part of Math/ImpactQuery.h: sides and closest points at an impact.
#include "Math/ClosestPoint.h"
#include "Math/ImpactQuery.h"
#include "Math/RelativeMotion.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Exact/CubicRoot.h"
#include "Exact/ExactVector.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace palpate {

namespace {

/// Sign of det(A, B, C) at a multiple of 2^-53 of the step.
int exactSideAt(const ImpactQuery& query, double time) {
  const Integer elapsed = std::ldexp(time, 53), remaining = 0x1p53 - elapsed;
  std::array<exact::Vector<Integer>, 3> rows;
  const auto axes = ImpactQuery::axes(query.kind);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      const auto coordinate = [&](int vertex) -> Integer {
        const ImpactQuery::Step& step = query.vertices[vertex];
        return scaledInteger(step.before[k]) * remaining + scaledInteger(step.now[k]) * elapsed;
      };
      rows[i][k] = coordinate(axes[i][0]) - coordinate(axes[i][1]);
    }
  const auto& [a, b, c] = rows;
  return exact::signOf(exact::volumeOf(a, b, c));
}

/// The first side that is not zero at times further and further before the impact.
int exactSide(const ImpactQuery& query, double time, std::size_t* exactDecisions) {
  if (exactDecisions) ++*exactDecisions;
  for (double back = kFirstStepBack;; back *= 0x1p8) {
    const double t = std::max(time - back, 0.0);
    const int sign = exactSideAt(query, t);
    if (sign != 0 || t == 0.0) return sign;
  }
}

template <ImpactQuery::Kind kind>
int side(const ImpactQuery& query, double time, std::size_t* exactDecisions) {
  RelativeMotion<kind> motion(query);
  for (auto* ends : {&motion.a, &motion.b, &motion.c}) {
    const double largest =
        std::max((*ends)[0].cwiseAbs().maxCoeff(), (*ends)[1].cwiseAbs().maxCoeff());
    if (!(largest > 0.0 && std::isfinite(largest))) return exactSide(query, time, exactDecisions);
    for (Eigen::Vector3d& end : *ends) end /= largest;
  }
  // Goes further and further back until the side is beyond rounding.
  for (double back = kFirstStepBack;; back *= 0x1p8) {
    const double t = std::max(time - back, 0.0);
    const double volume = at(t, motion.a).cross(at(t, motion.b)).dot(at(t, motion.c));
    if (volume > kSideError) return 1;
    if (volume < -kSideError) return -1;
    if (t == 0.0) return exactSide(query, time, exactDecisions);
  }
}

/// Whether all vertices have one coordinate in common at both ends: aligned features that slide.
bool stayInAxisPlane(const ImpactQuery& query) {
  const auto isShared = [&](int axis) {
    const ImpactQuery::Step& first = query.vertices[0];
    return std::all_of(query.vertices.begin(), query.vertices.end(), [&](const auto& vertex) {
      return vertex.before[axis] == first.before[axis] && vertex.now[axis] == first.now[axis];
    });
  };
  return isShared(0) || isShared(1) || isShared(2);
}

}  // namespace

int sideBefore(const ImpactQuery& query, double time, std::size_t* exactDecisions) {
  PALPATE_ASSERT(time >= 0.0 && time <= 1.0);
  if (stayInAxisPlane(query)) return 0;
  return query.kind == ImpactQuery::Kind::VertexTriangle
             ? side<ImpactQuery::Kind::VertexTriangle>(query, time, exactDecisions)
             : side<ImpactQuery::Kind::EdgeEdge>(query, time, exactDecisions);
}

std::array<Eigen::Vector3d, 4> positionsAt(const ImpactQuery& query, double time) {
  PALPATE_ASSERT(time >= 0.0 && time <= 1.0);
  std::array<Eigen::Vector3d, 4> p;
  const auto place = [&](const Eigen::Vector3d& start, const Eigen::Vector3d& end) {
    for (int i = 0; i < 4; ++i)
      p[i] =
          (1.0 - time) * (query.vertices[i].at(0) - start) + time * (query.vertices[i].at(1) - end);
  };
  place(query.vertices[0].at(0), query.vertices[0].at(1));
  const bool finite = std::all_of(
      p.begin(), p.end(), [](const Eigen::Vector3d& position) { return position.allFinite(); });
  if (!finite) place(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  return p;
}

namespace {

using Eigen::Vector3d;

/// The closest points of both features at one time.
struct ClosestPoints {
  Vector3d difference;            ///< L: from the second feature to the first
  double distance;                ///< L
  std::array<double, 4> weights;  ///< of the vertices in `difference`
  /// The edges, by two vertices, whose interiors hold a closest point; equal vertices: none.
  std::array<ImpactQuery::Difference, 2> edges;
};

ClosestPoints closestPointsOf(ImpactQuery::Kind kind, const std::array<Vector3d, 4>& p) {
  if (kind == ImpactQuery::Kind::VertexTriangle) {
    const auto found = finiteVertexTriangleDistance(p[0], p[1], p[2], p[3]);
    const Vector3d& w = found.weights;
    ClosestPoints closest{found.difference, found.distance, {1.0, -w[0], -w[1], -w[2]}, {}};
    const int edge = static_cast<int>(found.feature) - static_cast<int>(TriangleFeature::EdgeAB);
    if (edge >= 0 && found.feature != TriangleFeature::Face)
      closest.edges[0] = {1 + edge, 1 + (edge + 1) % 3};
    return closest;
  }
  const auto found = finiteEdgeEdgeDistance(p[0], p[1], p[2], p[3]);
  ClosestPoints closest{found.difference,
                        found.distance,
                        {1.0 - found.weightA, found.weightA, found.weightB - 1.0, -found.weightB},
                        {}};
  if (found.featureA == EdgeFeature::Interior) closest.edges[0] = {0, 1};
  if (found.featureB == EdgeFeature::Interior) closest.edges[1] = {2, 3};
  return closest;
}

/// The closest points at the latest time, not after `time`, at which their distance is beyond the
/// rounding of positions. At the step's start positions have no rounding: if the features touch
/// there, that time is taken.
ClosestPoints closestPointsBefore(const ImpactQuery& query, double time) {
  const auto& v = query.vertices;
  const ClosestPoints atStart =
      closestPointsOf(query.kind, {v[0].before, v[1].before, v[2].before, v[3].before});
  if (atStart.distance == 0.0) return atStart;
  for (double back = 0.0; back < time; back = back == 0.0 ? kFirstStepBack : back * 0x1p8) {
    const std::array<Vector3d, 4> p = positionsAt(query, time - back);
    double extent = 0.0;
    for (int i = 1; i < 4; ++i) extent = std::max(extent, (p[i] - p[0]).cwiseAbs().maxCoeff());
    ClosestPoints closest = closestPointsOf(query.kind, p);
    if (closest.distance > kCertainDirection * extent) return closest;
  }
  return atStart;
}

/// The same motion at another scale if all coordinates are tiny: interpolated denormals would have
/// no direction.
ImpactQuery withoutDenormals(ImpactQuery query) {
  double largest = 0.0;
  for (const ImpactQuery::Step& vertex : query.vertices)
    for (const int end : {0, 1}) largest = std::max(largest, vertex.at(end).cwiseAbs().maxCoeff());
  if (largest < kTinyLength)
    for (ImpactQuery::Step& vertex : query.vertices)
      vertex = {vertex.before / kTinyLength, vertex.now / kTinyLength};
  return query;
}

/// The part of a vector that is perpendicular to the edges, which are given by their ends.
Vector3d partAcross(const Vector3d& vector, const std::array<ImpactQuery::Difference, 2>& edges,
                    const std::array<Vector3d, 4>& p) {
  const Vector3d u = stableUnit(p[edges[0][1]] - p[edges[0][0]]),
                 v = stableUnit(p[edges[1][1]] - p[edges[1][0]]), plane = u.cross(v);
  if (plane.norm() > kCertainDirection) {
    const Vector3d unit = stableUnit(plane);
    return vector.dot(unit) * unit;
  }
  const Vector3d& along = u == Vector3d::Zero() ? v : u;
  return vector - vector.dot(along) * along;
}

}  // namespace

std::optional<Approach> approachOf(const ImpactQuery& given, double time) {
  PALPATE_ASSERT(time >= 0.0 && time <= 1.0);
  const ImpactQuery query = withoutDenormals(given);
  const ClosestPoints closest = closestPointsBefore(query, time);
  if (closest.distance == 0.0) return {};
  const std::array<Vector3d, 4> p = positionsAt(query, time);
  const ClosestPoints meeting = closestPointsOf(query.kind, p);
  // Displacements have no rounding of positions at a time.
  Vector3d across = Vector3d::Zero(), origin = across;
  double largest = 0.0;
  for (int i = 0; i < 4; ++i) {
    const Vector3d displacement = query.vertices[i].now - query.vertices[i].before;
    across -= closest.weights[i] * displacement;
    origin -= meeting.weights[i] * displacement;
    largest = std::max(largest, displacement.cwiseAbs().maxCoeff());
  }
  across = partAcross(across, closest.edges, p);
  const Vector3d direction = stableUnit(closest.difference);
  const bool isCertain = across.cwiseAbs().maxCoeff() > kCertainDirection * largest;
  const Vector3d unit = stableUnit(across);
  return Approach{isCertain && unit.dot(direction) > 0.0 ? unit : direction, stableUnit(origin)};
}

std::optional<Vector3d> normalOfPlane(const ImpactQuery& query, double time,
                                      std::size_t& exactDecisions) {
  const int side = sideBefore(query, time, &exactDecisions);
  if (side == 0) return {};
  const std::array<Vector3d, 4> p = positionsAt(query, time);
  const Vector3d normal = query.kind == ImpactQuery::Kind::VertexTriangle
                              ? windingNormal(p[1], p[2], p[3])
                              : normalOfCrossing(p[0], p[1], p[0], p[0] + (p[3] - p[2]));
  return side < 0 ? Vector3d(-normal) : normal;
}

}  // namespace palpate
