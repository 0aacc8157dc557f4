#include "Queries/RayHits.h"

#include "Queries/ElementDistance.h"
#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Math/RoundSegment.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <initializer_list>

namespace palpate {

using Eigen::Vector3d;

RayHits::RayHits(const Body& geometry, const Ray& ray, bool bruteForce, std::vector<Met>& scratch,
                 double radius)
    : m_geometry(geometry),
      m_ray{ray.origin, ray.direction, ray.tMin, ray.tMax},
      m_bruteForce(bruteForce),
      m_radius(radius),
      m_isSolid(geometry.mesh.largestRadius + radius > 0),
      m_met(scratch) {}

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
  const double radius = m_geometry.mesh.largestRadius + m_radius;
  if (!m_inOctree.clip(m_geometry, m_ray, radius, task.ray, task.elements.line)) return false;
  m_end = task.ray.tMax;
  m_tMax = task.ray.tMax = std::min(m_end, m_inOctree.floatOf(m_least));
  return true;
}

float RayHits::take(void* context, std::uint32_t place) {
  RayHits& hits = *static_cast<RayHits*>(context);
  hits.add(place);
  if (hits.m_wanted == Wanted::Any && !hits.m_met.empty()) return -1.0f;
  if (hits.m_first == kInfinity) return hits.m_tMax;
  const double least = std::max(hits.m_last + hits.m_error, hits.m_atLeast);
  return std::min(hits.m_end, hits.m_inOctree.floatOf(least));
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

void firstHits(const Body& geometry, std::span<const Ray> rays, bool bruteForce,
               std::array<std::vector<RayHits::Met>, kRaysInFlight>& scratch, const RayHit& none,
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

}  // namespace palpate
