#include "Queries/PathIntervals.h"

#include "Queries/GeometryDistances.h"
#include "Queries/PointDistances.h"
#include "Queries/ShapeRays.h"
#include "Queries/SurfaceNormal.h"
#include "Queries/VertexSearch.h"
#include "Math/StableLength.h"
#include "Exact/Compensated.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

PathLine::PathLine(std::span<const Vector3d> points, std::vector<double>& scratch)
    : m_points(points), m_lengths(scratch) {
  PALPATE_ASSERT(!points.empty());
  m_lengths.assign(1, 0.0);
  for (std::size_t i = 0; i + 1 < points.size(); ++i)
    m_lengths.push_back(m_lengths.back() + stableLength(points[i + 1] - points[i]));
}

Vector3d PathLine::operator()(double arcLength) const {
  PALPATE_ASSERT(m_lengths.size() >= 2 && arcLength >= 0.0);
  const auto next = std::upper_bound(m_lengths.begin() + 1, m_lengths.end() - 1, arcLength);
  const auto segment = static_cast<std::size_t>(next - m_lengths.begin()) - 1;
  const double from = m_lengths[segment], length = m_lengths[segment + 1] - from;
  const double t = length > 0.0 ? (arcLength - from) / length : 0.0;
  return point(segment) + t * (point(segment + 1) - point(segment));
}

namespace {

/// Appends a part, or joins it to the last one if they touch.
void append(const PathPart& part, std::vector<PathPart>& parts) {
  PALPATE_ASSERT(part.enter <= part.leave);
  if (parts.empty() || part.enter > parts.back().leave) return parts.push_back(part);
  PathPart& last = parts.back();
  if (part.leave > last.leave) {
    last.leave = part.leave;
    last.exitElement = part.exitElement;
  }
}

/// A place between `from` and `to`, of which either may be the lower one, where f changes from
/// above 0, at `from`, to at most 0, at `to`.
template <class F>
double rootBetween(double from, double to, F&& f) {
  for (;;) {
    const double middle = from + 0.5 * (to - from);
    if (middle == from || middle == to) return to;
    (f(middle) > 0.0 ? from : to) = middle;
  }
}

}  // namespace

void findPathParts(const Body& body, const PathLine& path, double radius, bool bruteForce,
                   std::vector<RayHits::Met>& met, PathScratch& scratch) {
  // Where a segment with a rounded direction is divided. No value is likely to be special.
  constexpr double kDivision = 0.618;
  std::vector<PathPart>& parts = scratch.parts;
  parts.clear();
  if (body.tree.ordered().empty()) return;
  if (path.length() == 0.0) {
    const auto near = PointDistances(body, path.point(0), bruteForce).nearest(radius, kNoElement);
    if (near) parts.push_back({0.0, 0.0, near->element, near->element});
    return;
  }
  for (std::size_t i = 0; i < path.segments(); ++i) {
    const Vector3d &p = path.point(i), &q = path.point(i + 1);
    if (p == q) continue;
    // Paths often turn on a surface. A ray with a rounded direction from one end may miss the other
    // end. The far part of the segment is therefore followed backwards.
    const auto [direction, lost] = difference(q, p);
    const bool isDivided = radius == 0.0 && lost != Vector3d::Zero();
    const Ray ray{p, direction, 0.0, isDivided ? kDivision : 1.0};
    RayHits(body, ray, bruteForce, met, radius).forAllParts([&](const RayHits::Part& part) {
      append({path.at(i, part.first), path.at(i, part.last), part.entryElement, part.exitElement},
             parts);
    });
    if (!isDivided) continue;
    std::vector<PathPart>& backwards = scratch.backwards;
    backwards.clear();
    const Ray back{q, -direction, 0.0, 1.0 - kDivision};
    RayHits(body, back, bruteForce, met, radius).forAllParts([&](const RayHits::Part& part) {
      backwards.push_back({path.at(i, 1.0 - part.last), path.at(i, 1.0 - part.first),
                           part.exitElement, part.entryElement});
    });
    for (; !backwards.empty(); backwards.pop_back()) append(backwards.back(), parts);
  }
}

void addInvertedFaces(const Body& solid, const PathLine& path, bool bruteForce,
                      PointQueryStack& stack, PathScratch& scratch) {
  PALPATE_ASSERT(solid.prepared->tetrahedraVersion.isValid());
  const Positions& now = solid.mesh.now;
  const TetrahedralTopology& topology = solid.solid->topology;
  const TetrahedronTree& tree = *solid.prepared->tetrahedra;
  const PointFrame frame(solid);
  std::vector<PathPart>& inner = scratch.inner;
  inner.clear();
  SignCounts counts;
  for (std::size_t i = 0; i < path.segments(); ++i) {
    const Vector3d &p = path.point(i), &q = path.point(i + 1);
    if (p == q) continue;
    const RaySegment segment{p, q - p, 0.0, 1.0};
    const auto addFaces = [&](std::uint32_t tetrahedron) {
      const Tetrahedron& t = topology.tetrahedra[tetrahedron];
      const Vector3d corners[] = {now[t[0]], now[t[1]], now[t[2]], now[t[3]]};
      const int sign = orient3d(corners[0], corners[1], corners[2], corners[3], counts);
      if (sign == (topology.isPositive[tetrahedron] ? 1 : -1)) return;
      for (const auto& [a, b, c] : {Triangle{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}})
        if (const auto met = intersectRay(segment, corners[a], corners[b], corners[c]))
          for (const double at : {path.at(i, met->first), path.at(i, met->last)})
            inner.push_back({at, at, kNoElement, kNoElement, false});
    };
    if (bruteForce) {
      topology.forEach(addFaces);
    } else if (tree.octree().size() > 0) {
      FloatBox box = frame.boxOf(p);
      box.add(frame.boxOf(q));
      findOverlapping(tree.octree(), frame.map(), box, stack);
      for (const std::uint32_t place : stack.found) addFaces(tree.octree().order()[place]);
    }
  }
  if (inner.empty()) return;
  inner.insert(inner.end(), scratch.parts.begin(), scratch.parts.end());
  std::sort(inner.begin(), inner.end(), [](const PathPart& a, const PathPart& b) {
    return std::pair(a.enter, !a.isSurface) < std::pair(b.enter, !b.isSurface);
  });
  scratch.parts.clear();
  for (const PathPart& part : inner)
    if (part.isSurface || scratch.parts.empty() || part.enter > scratch.parts.back().leave)
      scratch.parts.push_back(part);
}

void findPathParts(const Shape& shape, const PathLine& path, double radius,
                   std::vector<PathPart>& parts) {
  parts.clear();
  // A point on the boundary of a solid shape is not inside.
  const auto isInside = [&](double distance) {
    return radius > 0.0 || shape.isTwoSided() ? distance <= radius : distance < 0.0;
  };
  for (std::size_t i = 0; i < path.segments(); ++i) {
    const Vector3d &p = path.point(i), &q = path.point(i + 1);
    if (p == q) {
      if (isInside(shape.signedDistance(p).distance))
        append({path.start(i), path.start(i), kNoElement, kNoElement}, parts);
      continue;
    }
    // The distance along a segment is convex.
    const NearestToShape nearest = shape.nearestOfEdge(p, q);
    if (!isInside(nearest.distance)) continue;
    const auto above = [&](double t) {
      return shape.signedDistance(p + t * (q - p)).distance - radius;
    };
    const double least = nearest.weights[1];
    const double first = above(0.0) > 0.0 ? rootBetween(0.0, least, above) : 0.0,
                 last = above(1.0) > 0.0 ? rootBetween(1.0, least, above) : 1.0;
    append({path.at(i, first), path.at(i, last), kNoElement, kNoElement}, parts);
  }
}

PathClearance clearanceOf(const Body& body, const PathLine& path, double radius, bool bruteForce) {
  PathClearance best{body.id,
                     kInfinity,
                     0.0,
                     {body.id, kNoElement, {}, Vector3d::Zero(), Vector3d::Zero(), kInfinity}};
  Vector3d onPath = Vector3d::Zero();
  const auto take = [&](double distance, double at, const Vector3d& from,
                        const SurfacePoint& nearest) {
    if (!(distance < best.distance)) return;
    best = {body.id, distance, at, nearest};
    onPath = from;
  };
  for (std::size_t i = 0; i < path.segments(); ++i) {
    const Vector3d &p = path.point(i), &q = path.point(i + 1);
    if (body.shape) {
      const double t = p == q ? 0.0 : body.shape->now.nearestOfEdge(p, q).weights[1];
      const Vector3d from = p + t * (q - p);
      const SurfacePoint nearest = closestPointOnShape(body.id, body.shape->now, from);
      take(nearest.distance, path.at(i, t), from, nearest);
    } else if (!body.tree.ordered().empty()) {
      const auto [t, nearest] = distanceFromSegment(body, p, q, best.distance, bruteForce);
      if (nearest.element != kNoElement)
        take(nearest.distance, path.at(i, t), p + t * (q - p), nearest);
    }
  }
  setNormal(body, onPath - best.nearest.position, best.nearest);
  best.distance = best.nearest.distance = std::max(0.0, best.distance - radius);
  return best;
}

}  // namespace palpate
