#include "Queries/RayHits.h"

#include "Queries/ElementDistance.h"
#include "Bodies/OctreeFrame.h"
#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Math/RoundSegment.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <memory>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Moves `enter` and `leave` to where a ray enters a box that is grown by `slack`, and leaves it.
/// Where it does not enter, `leave` is then less.
void clipTo(const FloatBox& box, double slack, const Vector3d& origin, const Vector3d& direction,
            double& enter, double& leave) {
  for (int k = 0; k < 3; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const double lower = box.lower[at] - slack, upper = box.upper[at] + slack;
    if (direction[k] == 0.0) {
      if (origin[k] < lower || origin[k] > upper) leave = -std::numeric_limits<double>::infinity();
      continue;
    }
    const double s = (lower - origin[k]) / direction[k], t = (upper - origin[k]) / direction[k];
    const double margin = kNearestError * std::max(std::abs(s), std::abs(t));
    enter = std::max(enter, std::min(s, t) - margin);
    leave = std::min(leave, std::max(s, t) + margin);
  }
}

}  // namespace

RayHits::RayHits(const Body& geometry, const Ray& ray, bool bruteForce, std::vector<Met>& scratch,
                 double radius)
    : m_geometry(geometry),
      m_ray{ray.origin, ray.direction, ray.tMin, ray.tMax},
      m_bruteForce(bruteForce),
      m_radius(radius),
      m_isSolid(geometry.mesh.largestRadius + radius > 0),
      m_met(scratch) {}

/// Never negative, which would end the traversal: m_start is rounded.
float RayHits::floatOf(double t) const {
  const double along = (t * m_perT - m_start) * (1.0 + kNearestError);
  return std::max(OutwardRounding::up(along), 0.0f);
}

bool RayHits::clip(FloatRay& clipped, LineFilter& line) {
  std::construct_at(&line);  // in place here and below, as a copy would wait for each part
  const RaySegment& ray = m_ray;
  const double radius = m_geometry.mesh.largestRadius + m_radius;  // by which boxes grow
  const OctreeFrame frame(m_geometry);
  const FloatBox root = m_geometry.tree.octree().box(0);
  double extent = root.reach();
  const double error = frame.error() + (m_geometry.isPlaced() ? 4.0 * kOrthonormal * extent : 0.0);
  Vector3d origin = frame.toFrame(ray.origin), direction = frame.turned(ray.direction);
  Eigen::Index axis;
  const double length = direction.cwiseAbs().maxCoeff(&axis), perT = length * frame.scale();
  direction /= length;
  extent += radius * frame.scale();
  // A ray from far away begins where it enters the grown root box.
  double enter = ray.tMin * perT, leave = ray.tMax * perT;
  const double far = origin.cwiseAbs().maxCoeff(), reach = far + std::abs(enter);
  const bool isNear = reach <= 4.0 * extent;
  // With S the extent and the reach, all coordinates are at most S, and t grows by at most three
  // times that. Its floats err by at most 2^-20 of it; kFloatRayError has a margin. The rest are
  // errors of the origin in double.
  const double doubleError =
      kPlacedPointError * far + error + radius * (1.0 + kNearestError) * frame.scale();
  const double slack =
      kFloatRayError * (extent + (isNear ? reach : 0.0)) + doubleError + OutwardRounding::kAbsolute;
  clipped.slack = OutwardRounding::up(slack);
  m_perT = perT;
  if (!(extent < kLargestFloat) || !(perT >= 0x1p-900) || !(perT <= 0x1p900) ||
      !(slack < kLargestFloat)) {  // every box is entered at once
    clipped.origin = {};
    clipped.inverse = {1, 1, 1};
    clipped.slack = clipped.tMax = std::numeric_limits<float>::infinity();
    m_perT = m_start = 0.0;
    return true;
  }
  for (int k = 0; k < 3; ++k) {
    // A smaller component moves the ray by less than the slack.
    const double least = std::copysign(std::max(std::abs(direction[k]), 0x1p-100), direction[k]);
    clipped.inverse[static_cast<std::size_t>(k)] = 1.0f / static_cast<float>(least);
  }
  if (!isNear) clipTo(root, slack, origin, direction, enter, leave);
  if (!(enter <= leave)) return false;
  m_start = enter;
  clipped.tMax = OutwardRounding::up((leave - enter) * (1.0 + kNearestError));
  origin += enter * direction;
  for (int k = 0; k < 3; ++k)
    clipped.origin[static_cast<std::size_t>(k)] = static_cast<float>(origin[k]);
  if (radius == 0) {
    const double unit = frame.unit(), most = extent + origin.cwiseAbs().maxCoeff();
    const Vector3d& zero = m_geometry.tree.frame().origin;
    std::construct_at(&line, unit * origin + zero, direction, static_cast<int>(axis), unit * most,
                      unit * (doubleError + kPlacedPointError * most) +
                          kPlacedPointError * zero.cwiseAbs().maxCoeff());
  }
  return true;
}

template <class F>
void RayHits::intersect(std::uint32_t place, F&& f) const {
  const auto& [a, b, c] = m_geometry.tree.ordered()[place];
  const TriangleMesh& mesh = m_geometry.mesh;
  if (!m_isSolid) {
    if (const auto interval =
            intersectRay(m_ray, mesh.now[a], mesh.now[b], mesh.now[c], &m_exactDecisions))
      f(*interval);
    return;
  }
  if (mesh.topology.hasFaces()) {
    if (const auto interval = intersectRay(m_ray, mesh.now[a], mesh.now[b], mesh.now[c], m_radius))
      f(*interval);
    return;
  }
  if (const auto interval = intersectRay(m_ray, mesh.now[a], mesh.now[b], mesh.radius(a) + m_radius,
                                         mesh.radius(b) + m_radius))
    f(*interval);
}

void RayHits::add(std::uint32_t place) {
  intersect(place, [&](const RayInterval& interval) {
    m_met.push_back({interval, place, m_geometry.tree.octree().order()[place]});
    if (m_wanted != Wanted::First || interval.first - interval.error > m_last + m_error) return;
    const bool isApart = m_first == kInfinity || interval.last + interval.error < m_first - m_error;
    m_first = std::min(m_first, interval.first);
    m_last = isApart ? interval.last : std::max(m_last, interval.last);
    m_error = std::max(m_error, interval.error);
    m_least = std::min(m_least, std::max(m_last + m_error, m_atLeast));
  });
}

bool RayHits::start(Wanted wanted, double bound, double atLeast, RayTask& task) {
  m_met.clear();
  m_wanted = wanted;
  m_atLeast = atLeast;
  m_first = kInfinity;
  m_last = m_ray.tMax;
  m_error = 0.0;
  m_least = std::max(bound, atLeast);
  if (m_geometry.tree.ordered().empty()) return false;
  if (m_bruteForce) {
    for (std::uint32_t place = 0; place < m_geometry.tree.ordered().size(); ++place) add(place);
    return false;
  }
  task = {
      {m_geometry.tree.ordered().data(), m_geometry.mesh.now.body().data(), {}}, {}, this, take};
  if (!clip(task.ray, task.elements.line)) return false;
  m_end = task.ray.tMax;
  m_tMax = task.ray.tMax = std::min(m_end, floatOf(m_least));
  return true;
}

float RayHits::take(void* context, std::uint32_t place) {
  RayHits& hits = *static_cast<RayHits*>(context);
  hits.add(place);
  if (hits.m_wanted == Wanted::Any && !hits.m_met.empty()) return -1.0f;
  if (hits.m_first == kInfinity) return hits.m_tMax;
  return std::min(hits.m_end, hits.floatOf(std::max(hits.m_last + hits.m_error, hits.m_atLeast)));
}

double RayHits::end() {
  if (m_first == kInfinity || m_bruteForce) return m_atLeast;
  // Elements come in any order. Some were met before the part had grown as far as to them.
  std::sort(m_met.begin(), m_met.end(),
            [](const Met& a, const Met& b) { return a.interval.first < b.interval.first; });
  for (const auto& [interval, place, element] : m_met) {
    if (interval.first - interval.error > m_last + m_error) break;
    m_last = std::max(m_last, interval.last);
    m_error = std::max(m_error, interval.error);
  }
  const double needed = std::min(m_ray.tMax, m_last + m_error);
  return needed > m_least ? needed : m_atLeast;
}

double RayHits::collect(Wanted wanted, double bound, double atLeast) {
  RayTask task;
  if (start(wanted, bound, atLeast, task)) traverseRay(m_geometry.tree.octree(), task);
  return end();
}

int RayHits::compare(const Met& one, bool lastOfFirst, const Met& two, bool lastOfSecond) const {
  const double s = lastOfFirst ? one.interval.last : one.interval.first,
               t = lastOfSecond ? two.interval.last : two.interval.first;
  if (std::abs(s - t) > one.interval.error + two.interval.error || m_isSolid ||
      one.interval.error + two.interval.error == 0)
    return (s > t) - (s < t);
  if (one.place == two.place && lastOfFirst == lastOfSecond) return 0;
  const Triangle &first = m_geometry.tree.ordered()[one.place],
                 &second = m_geometry.tree.ordered()[two.place];
  const Positions& now = m_geometry.mesh.now;
  const Vector3d a = now[first[0]], b = now[first[1]], c = now[first[2]], d = now[second[0]],
                 e = now[second[1]], f = now[second[2]];
  // Triangles with the same corners share the same part of the ray.
  const auto hasAll = [](const Vector3d& p, const Vector3d& q, const Vector3d& r,
                         std::initializer_list<const Vector3d*> others) {
    return std::all_of(others.begin(), others.end(), [&](const Vector3d* other) {
      return *other == p || *other == q || *other == r;
    });
  };
  if (lastOfFirst == lastOfSecond && hasAll(a, b, c, {&d, &e, &f}) && hasAll(d, e, f, {&a, &b, &c}))
    return 0;
  ++m_exactDecisions;
  return exact::compareRayEnds(m_ray, {a, b, c, lastOfFirst}, {d, e, f, lastOfSecond});
}

RayHit RayHits::hitOf(const Met& met, double t, bool frontFace, bool crosses) const {
  const Triangle& corners = m_geometry.tree.ordered()[met.place];
  const Positions& now = m_geometry.mesh.now;
  const auto [a, b, c] = cornersOf(corners, now);
  if (!m_isSolid) {
    const RayPoint at = firstPoint(m_ray, met.interval, a, b, c, &m_exactDecisions);
    return {m_geometry.id, met.element, corners, at.weights, at.t, frontFace, crosses};
  }
  const TriangleMesh& mesh = m_geometry.mesh;
  const Vector3d point = m_ray.origin + t * m_ray.direction;
  if (mesh.radius(corners[0]) != mesh.radius(corners[1])) {
    const double weight =
        nearestBall(point, a, b, mesh.radius(corners[0]), mesh.radius(corners[1]));
    return {m_geometry.id, met.element, corners, edgeWeights(0, weight), t, frontFace, crosses};
  }
  const Vector3d weights = finiteVertexTriangleDistance(point, a, b, c).weights;
  return {m_geometry.id, met.element, corners, weights, t, frontFace, crosses};
}

/// The hits of the part of m_met in [begin, end), whose entry `furthest` ends last.
template <class F>
bool RayHits::hitsOfPart(std::size_t begin, std::size_t end, std::size_t furthest, F&& f) const {
  PALPATE_ASSERT(begin <= furthest && furthest < end && end <= m_met.size());
  const Met& first = m_met[begin];
  if (!m_isSolid) {
    int crossing = 0;
    for (std::size_t i = begin; i < end; ++i) crossing += m_met[i].interval.crossing;
    return f(hitOf(first, first.interval.first, first.interval.frontFace, crossing % 2 != 0));
  }
  // The ends of a solid part are hits, except where an element holds the ray's own begin or end.
  const Met& last = m_met[furthest];
  bool enters = true, leaves = true;
  for (std::size_t i = begin; i < end; ++i) {
    enters = enters && m_met[i].interval.frontFace;
    leaves = leaves && m_met[i].interval.crossing != 0;
  }
  if (enters && leaves && first.interval.first == last.interval.last)  // they touch
    return f(hitOf(first, first.interval.first, true, false));
  if (enters && !f(hitOf(first, first.interval.first, true, true))) return false;
  return !leaves || f(hitOf(last, last.interval.last, false, true));
}

void RayHits::sort() {
  std::sort(m_met.begin(), m_met.end(), [&](const Met& a, const Met& b) {
    const int order = compare(a, false, b, false);
    return order < 0 || (order == 0 && a.element < b.element);
  });
}

template <class F>
void RayHits::forEachHit(F&& f) {
  forEachPart([&](std::size_t begin, std::size_t end, std::size_t furthest) {
    return hitsOfPart(begin, end, furthest, f);
  });
}

bool RayHits::startFirst(double bound, RayTask& task) {
  return start(m_isSolid ? Wanted::All : Wanted::First, bound, m_ray.tMin, task);
}

std::optional<RayHit> RayHits::endFirst(double bound) {
  // Elements beyond a part's end may have been skipped before the part grew. The search is then
  // repeated as far as the part is known.
  double atLeast = m_atLeast;
  for (double needed = end(); needed > atLeast; needed = collect(m_wanted, bound, atLeast))
    atLeast = needed;
  std::optional<RayHit> hit;
  forEachHit([&](const RayHit& first) {
    hit = first;
    return false;
  });
  return hit;
}

std::optional<RayHit> RayHits::first(double bound) {
  RayTask task;
  if (startFirst(bound, task)) traverseRay(m_geometry.tree.octree(), task);
  return endFirst(bound);
}

void RayHits::first(const Body& geometry, std::span<const Ray> rays, bool bruteForce,
                    std::array<std::vector<Met>, kRaysInFlight>& scratch, const RayHit& none,
                    std::span<RayHit> out) {
  PALPATE_ASSERT(rays.size() == out.size());
  // The processor's caches hold a small octree, and turns then cost more than they save.
  constexpr std::size_t kLeastForTurns = 30'000;
  if (bruteForce || geometry.tree.ordered().size() < kLeastForTurns) {
    for (std::size_t i = 0; i < rays.size(); ++i)
      out[i] =
          RayHits(geometry, rays[i], bruteForce, scratch[0]).first(rays[i].tMax).value_or(none);
    return;
  }
  struct InFlight {
    std::optional<RayHits> hits;
    std::size_t ray;
  };
  std::array<InFlight, kRaysInFlight> inFlight;
  std::array<RayTask, kRaysInFlight> tasks;
  std::size_t begun = 0;
  const auto end = [&](InFlight& one) {
    out[one.ray] = one.hits->endFirst(rays[one.ray].tMax).value_or(none);
  };
  auto next = [&](std::size_t i) {
    InFlight& one = inFlight[i];
    if (one.hits) end(one);
    for (; begun < rays.size(); end(one)) {
      one.ray = begun++;
      one.hits.emplace(geometry, rays[one.ray], bruteForce, scratch[i]);
      if (one.hits->startFirst(rays[one.ray].tMax, tasks[i])) return true;
    }
    return false;
  };
  traverseRays(geometry.tree.octree(), tasks, next);
}

bool RayHits::any() {
  // A solid element that holds the whole ray has no hit.
  if (m_isSolid) return first(m_ray.tMax).has_value();
  collect(Wanted::Any, m_ray.tMax, m_ray.tMin);
  return !m_met.empty();
}

void RayHits::all(std::vector<RayHit>& out) {
  collect(Wanted::All, m_ray.tMax, m_ray.tMin);
  double least = -kInfinity;  // hits are in order, but each t is rounded
  forEachHit([&](RayHit hit) {
    hit.t = least = std::max(least, hit.t);
    out.push_back(hit);
    return true;
  });
}

}  // namespace palpate
