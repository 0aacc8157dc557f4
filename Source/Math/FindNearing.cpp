// Part of Math/Nearing.h: the times at which features come nearer.
#include "Math/Nearing.h"

#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Exact/Rational.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

namespace {

using Eigen::Vector3d;
using Kind = ImpactQuery::Kind;

/// The vertices of the first feature come before this one, those of the second from it on.
int firstOfSecond(Kind kind) { return kind == Kind::VertexTriangle ? 1 : 2; }

/// Calls f(i, j) for each vertex i of the first feature and j of the second.
template <class F>
void forEachVertexPair(Kind kind, F&& f) {
  for (int i = 0; i < firstOfSecond(kind); ++i)
    for (int j = firstOfSecond(kind); j < 4; ++j) f(i, j);
}

/// L: how far points of the features move relative to each other at most.
double motionOf(const ImpactQuery& query) {
  double most = 0;
  forEachVertexPair(query.kind, [&](int i, int j) {
    const auto &p = query.vertices[i], &q = query.vertices[j];
    most = std::max(most, stableLength((p.now - q.now) - (p.before - q.before)));
  });
  return most;
}

double largestDifference(const ImpactQuery& query) {
  double most = 0;
  forEachVertexPair(query.kind, [&](int i, int j) {
    for (const int end : {0, 1})
      most = std::max(
          most, (query.vertices[i].at(end) - query.vertices[j].at(end)).cwiseAbs().maxCoeff());
  });
  return most;
}

double distanceOf(Kind kind, const std::array<Vector3d, 4>& p) {
  return kind == Kind::VertexTriangle
             ? finiteVertexTriangleDistance(p[0], p[1], p[2], p[3]).distance
             : finiteEdgeEdgeDistance(p[0], p[1], p[2], p[3]).distance;
}

/// A segment, or a vertex, in pieces that have one radius each.
struct Pieces {
  const Vector3d &p, &q;
  double radiusP, radiusQ;
  int count() const { return radiusP == radiusQ ? 1 : kTaperPieces; }
  Vector3d at(int i) const {
    const double weight = static_cast<double>(i) / count();
    return (1.0 - weight) * p + weight * q;
  }
  double radius(int i) const {
    const auto radiusAt = [&](int end) {
      const double weight = static_cast<double>(end) / count();
      return (1.0 - weight) * radiusP + weight * radiusQ;
    };
    return std::max(radiusAt(i), radiusAt(i + 1));
  }
};

/// L: a lower bound, up to rounding, of the distance between the surfaces of the radii. Negative
/// where it is not known to be positive.
double clearanceAt(const ImpactQuery& query, const FeatureRadii& radii, double time) {
  const std::array<Vector3d, 4> p = positionsAt(query, time);
  double least = std::numeric_limits<double>::infinity();
  if (query.kind == Kind::VertexTriangle) {
    const Pieces pieces{p[1], p[2], radii[1], radii[2]};
    for (int i = 0; i < pieces.count(); ++i)
      least = std::min(least, finiteVertexTriangleDistance(p[0], pieces.at(i), pieces.at(i + 1),
                                                           pieces.at(i + 1))
                                      .distance -
                                  (radii[0] + pieces.radius(i)));
    return least;
  }
  const Pieces a{p[0], p[1], radii[0], radii[1]}, b{p[2], p[3], radii[2], radii[3]};
  for (int i = 0; i < a.count(); ++i)
    for (int j = 0; j < b.count(); ++j)
      least = std::min(least,
                       finiteEdgeEdgeDistance(a.at(i), a.at(i + 1), b.at(j), b.at(j + 1)).distance -
                           (a.radius(i) + b.radius(j)));
  return least;
}

bool varies(Kind kind, const FeatureRadii& radii) {
  if (kind == Kind::VertexTriangle) return radii[1] != radii[2];
  return radii[0] != radii[1] || radii[2] != radii[3];
}

}  // namespace

ImpactResult findNearing(const ImpactQuery& query, const FeatureRadii& radii, double tolerance) {
  PALPATE_ASSERT(*std::min_element(radii.begin(), radii.end()) >= 0.0 && tolerance > 0.0);
  const int second = firstOfSecond(query.kind);
  const double radius = *std::max_element(radii.begin(), radii.begin() + second) +
                        *std::max_element(radii.begin() + second, radii.end());
  if (radius == 0.0) return findTouch(query, tolerance);
  std::array<Vector3d, 4> before;
  for (int i = 0; i < 4; ++i) before[i] = query.vertices[i].before;
  const double distance = distanceOf(query.kind, before), motion = motionOf(query),
               error = kNearingSlack * (largestDifference(query) + radius);
  if (distance > radius) {
    const ImpactResult result = findApproach(query, radius, tolerance);
    if (!result.impact || result.time > 0.0) return result;
  } else if (varies(query.kind, radii)) {
    const auto time = timeOfNoClearance(
        motion, tolerance, [&](double at) { return clearanceAt(query, radii, at) - error; });
    if (!time) return {};
    if (*time > 0.0) return {true, false, *time};
  }
  const double kept =
      std::min(distance, radius) - (error + kNearingTolerances * tolerance * motion);
  if (kept > 0.0) {
    const ImpactResult result = findApproach(query, kept, tolerance);
    if (!result.impact || result.time > 0.0) return result;
  }
  return findTouch(query, tolerance);
}

bool certainlyPart(const ImpactQuery& query) {
  using Vector = exact::Vector<Integer>;
  using exact::operator-;
  const auto& [p, q, r, s] = query.vertices;
  const exact::Integers all(p.before, q.before, r.before, s.before, p.now, q.now, r.now, s.now);
  const auto before = [&](int i) -> const Vector& { return all.at[i]; };
  const auto now = [&](int i) -> const Vector& { return all.at[4 + i]; };
  const auto separates = [&](const Vector& normal) {
    int side = 0;
    bool separated = true;
    forEachVertexPair(query.kind, [&](int i, int j) {
      const int first = exact::signOf(exact::dot(normal, before(i) - before(j))),
                last = exact::signOf(exact::dot(normal, now(i) - now(j)));
      if (side == 0) side = last;
      separated = separated && last != 0 && last == side && first != -side;
    });
    return separated;
  };
  const auto [a, b, c] = ImpactQuery::axes(query.kind);
  const Vector u = before(a[0]) - before(a[1]), v = before(b[0]) - before(b[1]),
               normal = exact::cross(u, v);
  if (separates(normal)) return true;
  // How the first feature moves relative to the second.
  Vector motion{0, 0, 0};
  forEachVertexPair(query.kind, [&](int i, int j) {
    const Vector moved = (now(i) - now(j)) - (before(i) - before(j));
    for (int k = 0; k < 3; ++k) motion[k] += moved[k];
  });
  if (separates(motion)) return true;
  for (const Vector& along : {u, v, Vector(u - v)})
    if (separates(exact::cross(along, normal)) ||
        separates(exact::cross(along, exact::cross(motion, along))))
      return true;
  return false;
}

}  // namespace palpate
