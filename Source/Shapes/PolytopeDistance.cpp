// Part of Shapes/Polytope.h: distances.
#include "Shapes/Polytope.h"
#include "Math/Tolerances.h"
#include "Exact/Compensated.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

namespace {

using Eigen::Vector3d;
constexpr double kInfiniteDistance = std::numeric_limits<double>::infinity();

}  // namespace

/// A tangent of a convex function of t: the height of the highest plane at t, which is a lower
/// bound of the function elsewhere.
struct Polytope::Tangent {
  double t, height, slope;
  std::uint32_t plane;
};

/// The minimum of the function, and the tangents before and after it, which meet there.
struct Polytope::Minimum {
  double t, height;
  Tangent before, after;
  /// The weighted mean of f over the two tangents' planes, with weights that make the slopes cancel
  /// out.
  template <class F>
  double weightedMean(F&& f) const {
    if (!(after.slope > before.slope)) return f(before.plane);
    const double weight = std::clamp(after.slope / (after.slope - before.slope), 0.0, 1.0);
    return weight * f(before.plane) + (1 - weight) * f(after.plane);
  }
};

/// The minimum over [0, 1]; the height is within `tie` of the least.
/// Source   Kelley, The cutting-plane method for solving convex programs (1960), in one dimension.
///          For piecewise linear functions it finds the minimum after finitely many steps.
template <class At>
Polytope::Minimum Polytope::minimize(double tie, At&& at) {
  Tangent before = at(0.0);
  if (!(before.slope < 0)) return {0, before.height, before, before};
  Tangent after = at(1.0);
  if (!(after.slope > 0)) return {1, after.height, after, after};
  for (;;) {
    const double width = after.t - before.t;
    const double step =
        (after.height - before.height - after.slope * width) / (before.slope - after.slope);
    const double t = before.t + step, bound = before.height + before.slope * step;
    if (!(t > before.t && t < after.t)) {
      const Tangent& lower = after.height < before.height ? after : before;
      return {lower.t, lower.height, before, after};
    }
    const Tangent next = at(t);
    if (next.slope == 0) return {t, next.height, next, next};
    if (!(next.height > bound + tie)) return {t, next.height, before, after};
    (next.slope < 0 ? before : after) = next;
  }
}

/// The minimum of the highest plane's height along p + t (q - p).
Polytope::Minimum Polytope::minimizeOnSegment(const Vector3d& p, const Vector3d& q,
                                              double tie) const {
  const Vector3d along = q - p;
  return minimize(tie, [&](double t) {
    const Vector3d x = p + t * along;
    const std::uint32_t top = highestPlane(x, 0);
    return Tangent{t, m_planes[top].height(x), dot(m_planes[top].normal, along), top};
  });
}

std::uint32_t Polytope::highestPlane(const Vector3d& x, double tie) const {
  std::uint32_t best = 0;
  double height = -kInfiniteDistance;
  for (std::uint32_t i = 0; i < m_planes.size(); ++i) {
    const double value = m_planes[i].height(x);
    if (value > height + tie) best = i, height = value;
  }
  PALPATE_ASSERT(m_planes[best].face < m_faces.size());
  return best;
}

Polytope::OnFace Polytope::onFace(const Vector3d& x, std::uint32_t face) const {
  return {finiteVertexTriangleDistance(x, corner(face, 0), corner(face, 1), corner(face, 2)), face};
}

/// Calls f(face) for the other faces at the nearest edge or corner.
template <class F>
void Polytope::forEachAround(const OnFace& on, F&& f) const {
  const auto feature = static_cast<std::size_t>(on.from.feature);
  if (on.from.feature == TriangleFeature::Face) return;
  const Face& first = m_faces[on.face];
  if (feature >= 3) return f(first.neighbours[feature - 3]);
  const std::uint32_t vertex = first.corners[feature];
  for (std::uint32_t at = first.neighbours[feature]; at != on.face;) {
    f(at);
    const Face& face = m_faces[at];
    std::size_t i = 0;
    while (face.corners[i] != vertex) ++i;
    PALPATE_ASSERT(face.neighbours[i] < m_faces.size());
    at = face.neighbours[i];
  }
}

/// Walks to the face nearest to a point outside, over faces that the point is in front of. If none
/// of the surrounding faces is nearer, no face is, because the body is convex.
Polytope::OnFace Polytope::walkToNearest(const Vector3d& x, std::uint32_t face, double tie) const {
  OnFace best = onFace(x, face);
  for (bool nearer = true; nearer;) {
    nearer = false;
    const OnFace from = best;
    forEachAround(from, [&](std::uint32_t other) {
      if (m_planes[other].height(x) < -tie) return;
      const OnFace on = onFace(x, other);
      if (!(on.from.distance < best.from.distance)) return;
      best = on;
      nearer = true;
    });
  }
  return best;
}

Polytope::OnFace Polytope::nearest(const Vector3d& x, double tie) const {
  const Plane& top = m_planes[highestPlane(x, tie)];
  if (top.height(x) > tie) return walkToNearest(x, top.face, tie);
  OnFace best = onFace(x, top.face);
  for (const Plane& plane : m_planes) {
    if (!(plane.height(x) >= top.height(x) - tie)) continue;
    const Triangle& corners = m_faces[plane.face].corners;
    if (std::any_of(corners.begin(), corners.end(),
                    [&](std::uint32_t v) { return std::abs(top.height(m_points[v])) > tie; }))
      continue;
    const OnFace on = onFace(x, plane.face);
    if (on.from.distance < best.from.distance) best = on;
  }
  return best;
}

Polytope::OnFace Polytope::nearestFaceWithin(const Vector3d& x, double slack) const {
  const double top = m_planes[highestPlane(x, 0)].height(x);
  OnFace best{};
  best.from.distance = kInfiniteDistance;
  for (const Plane& plane : m_planes) {
    if (!(plane.height(x) >= top - slack)) continue;
    const OnFace on = onFace(x, plane.face);
    if (on.from.distance < best.from.distance) best = on;
  }
  return best;
}

const Vector3d& Polytope::normal(std::uint32_t face) const {
  const auto found = std::find_if(m_planes.begin(), m_planes.end(),
                                  [&](const Plane& plane) { return plane.face == face; });
  PALPATE_ASSERT(found != m_planes.end());
  return found->normal;
}

PointShapeDistance Polytope::signedDistance(const Vector3d& x, double tie) const {
  const Plane& top = m_planes[highestPlane(x, tie)];
  const double height = top.height(x);
  if (!(height > tie)) return {height, top.normal};
  const OnFace on = walkToNearest(x, top.face, tie);
  return {on.from.distance, on.from.normal};
}

double riseOf(std::span<const Vector3d> sides, const Vector3d& normal) {
  double rise = 0;
  for (const Vector3d& side : sides) rise += std::abs(dot(side, normal));
  return rise;
}

PointShapeDistance Polytope::leastDistance(const Vector3d& x, std::span<const Vector3d> sides,
                                           double tie) const {
  const PointShapeDistance any = signedDistance(x, tie);
  if (any.distance > tie) return any;
  const Plane* flattest = nullptr;
  double least = kInfiniteDistance;
  for (const Plane& plane : m_planes) {
    if (!(plane.height(x) >= any.distance - tie)) continue;
    const double rise = riseOf(sides, plane.normal);
    if (rise < least) flattest = &plane, least = rise;
  }
  return flattest ? PointShapeDistance{any.distance, flattest->normal} : any;
}

Vector3d Polytope::support(const Vector3d& direction, double tie) const {
  PALPATE_ASSERT(!m_points.empty() && tie >= 0.0);
  double most = -kInfiniteDistance;
  for (const Vector3d& p : m_points) most = std::max(most, dot(direction, p));
  Vector3d sum = Vector3d::Zero();
  double count = 0;
  for (const Vector3d& p : m_points)
    if (dot(direction, p) >= most - tie) sum += p, ++count;
  return sum / count;
}

/// The middle of the interval of t on which no plane is higher than `height`; an end of the edge if
/// the interval contains it.
double Polytope::sublevelMiddle(const Vector3d& p, const Vector3d& q, double t,
                                double height) const {
  double first = 0, last = 1;
  for (const Plane& plane : m_planes) {
    const double start = plane.height(p), slope = plane.height(q) - start;
    const double reached = (height - start) / slope;
    if (slope > 0) last = std::min(last, reached);
    if (slope < 0) first = std::max(first, reached);
  }
  if (first <= kEdgeWeight || last >= 1 - kEdgeWeight) return first <= kEdgeWeight ? 0 : 1;
  return first < last ? 0.5 * (first + last) : t;
}

double Polytope::leastOnEdge(const Vector3d& p, const Vector3d& q, double tie) const {
  const Vector3d along = q - p;
  const Minimum inside = minimizeOnSegment(p, q, tie);
  double t = inside.t;
  if (!(inside.height > tie)) return sublevelMiddle(p, q, t, inside.height + tie);
  // Alternates between the face nearest to a point of the edge and the edge's point nearest to that
  // face, until neither changes.
  OnFace on = nearest(p + t * along, tie);
  for (double least = kInfiniteDistance;;) {
    const Vector3d &a = corner(on.face, 0), &b = corner(on.face, 1), &c = corner(on.face, 2);
    const double start = finiteVertexTriangleDistance(p, a, b, c).distance,
                 end = finiteVertexTriangleDistance(q, a, b, c).distance;
    double distance = std::min(start, end), place = start <= end ? 0 : 1;
    for (int i = 0; i < 3; ++i) {
      const EdgeEdgeDistance edge =
          finiteEdgeEdgeDistance(p, q, corner(on.face, i), corner(on.face, (i + 1) % 3));
      if (edge.distance < distance) distance = edge.distance, place = edge.weightA;
    }
    if (!(distance < std::min(least, on.from.distance))) break;
    least = distance;
    t = place;
    on = walkToNearest(p + t * along, on.face, tie);
  }
  if (std::abs(dot(on.from.normal, along)) > tie) return t;
  const Vector3d down = on.from.distance * on.from.normal, touching = p + t * along - down;
  return sublevelMiddle(p - down, q - down, t,
                        m_planes[highestPlane(touching, 0)].height(touching) + tie);
}

std::optional<Vector3d> Polytope::leastInTriangle(const Vector3d& a, const Vector3d& b,
                                                  const Vector3d& c, double tie) const {
  const double boundary =
      std::min({minimizeOnSegment(a, b, tie).height, minimizeOnSegment(b, c, tie).height,
                minimizeOnSegment(c, a, tie).height});
  // For each s, the minimum on the line from a + s u to a + s v.
  const Vector3d u = b - a, v = c - a;
  const auto across = [&](double s) { return minimizeOnSegment(a + s * u, a + s * v, tie); };
  const double s =
      minimize(tie, [&](double at) {
        const Minimum line = across(at);
        const double growth = line.weightedMean([&](std::uint32_t plane) {
          const Vector3d& n = m_planes[plane].normal;
          return at > 0 ? dot(n, (1 - line.t) * u + line.t * v) : std::min(dot(n, u), dot(n, v));
        });
        return Tangent{at, line.height, growth, 0};
      }).t;
  const Minimum least = across(s);
  const Vector3d weights(1 - s, s * (1 - least.t), s * least.t);
  if (!(least.height < boundary - tie && least.height <= tie && weights.minCoeff() > kEdgeWeight))
    return {};
  return weights;
}

}  // namespace palpate
