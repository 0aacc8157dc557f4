#include "Queries/PointDistances.h"

#include "Queries/SurfaceNormal.h"
#include "Math/ClosestPoint.h"
#include "Math/DistanceBounds.h"
#include "Math/ExactClosestPoint.h"
#include "Math/RoundSegment.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Math/VertexTriangleDistances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate {

namespace {

NearestSearch searchOf(const Body& geometry, const Eigen::Vector3d& point) {
  const OctreeFrame frame(geometry);
  const FloatPoint p = FloatFrame::rounded(frame.toFrame(point));
  NearestSearch search{geometry.tree.octree(), geometry.tree.floats().now(),
                       geometry.tree.ordered().data(), p, frame.slackAt(p)};
  if (!geometry.mesh.radii.empty()) {
    const auto [least, most] =
        std::minmax_element(geometry.mesh.radii.begin(), geometry.mesh.radii.end());
    search.tolerance = OutwardRounding::up((*most - *least) * frame.scale());
  }
  return search;
}

/// The vertices of the feature that holds a closest point, ascending; unused places hold the last.
std::array<std::uint32_t, 3> verticesOf(const Triangle& corners, TriangleFeature feature) {
  const auto index = static_cast<std::size_t>(feature);
  std::array<std::uint32_t, 3> vertices = corners;
  if (index < 3) vertices.fill(corners[index]);
  if (index >= 3 && index < 6) {
    vertices = {corners[index - 3], corners[(index - 2) % 3], 0};
    vertices[2] = std::max(vertices[0], vertices[1]);
  }
  std::sort(vertices.begin(), vertices.end());
  return vertices;
}

}  // namespace

PointDistances::PointDistances(const Body& geometry, const Eigen::Vector3d& point, bool bruteForce)
    : m_geometry(geometry),
      m_point(point),
      m_bruteForce(bruteForce),
      m_search(searchOf(geometry, point)) {}

PointDistances::Near PointDistances::nearOf(std::uint32_t place, VertexTriangleDistance closest,
                                            double reach) const {
  const TriangleMesh& mesh = m_geometry.mesh;
  const Triangle& corners = m_geometry.tree.ordered()[place];
  if (isTapered(corners)) {
    const auto [p, q, _] = corners;
    const Eigen::Vector3d start = mesh.now[p], along = mesh.now[q] - start, from = m_point - start;
    const double weight = nearestBall(m_point, start, mesh.now[q], mesh.radii[p], mesh.radii[q]);
    closest.weights = {1.0 - weight, weight, 0.0};
    closest.difference = weight < 1.0 ? Eigen::Vector3d(from - weight * along)
                                      : Eigen::Vector3d(m_point - mesh.now[q]);
    closest.distance = stableLength(closest.difference);
    if (closest.distance > 0.0) closest.normal = closest.difference / closest.distance;
    closest.feature = TriangleFeature::EdgeAB;
  }
  return {place, m_geometry.tree.octree().order()[place], closest,
          closest.distance - mesh.radius(corners, closest.weights),
          kNearestSlack * 2 * std::max(reach, mesh.largestRadius)};
}

PointDistances::Near PointDistances::at(std::uint32_t place) const {
  const Triangle& corners = m_geometry.tree.ordered()[place];
  const Positions& now = m_geometry.mesh.now;
  const Eigen::Vector3d a = now[corners[0]], b = now[corners[1]], c = now[corners[2]];
  const auto largest = [&](const Eigen::Vector3d& q) {
    return (q - m_point).cwiseAbs().maxCoeff();
  };
  return nearOf(place, finiteVertexTriangleDistance(m_point, a, b, c),
                std::max({largest(a), largest(b), largest(c)}));
}

TriangleBatch PointDistances::batchOf(std::span<const std::uint32_t> places) const {
  PALPATE_ASSERT(places.size() <= TriangleBatch::kSize);
  const Positions& now = m_geometry.mesh.now;
  TriangleBatch batch;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto& [a, b, c] = m_geometry.tree.ordered()[places[i]];
    batch.set(i, now[a], now[b], now[c]);
  }
  return batch;
}

template <class F>
void PointDistances::forEach(std::span<const std::uint32_t> places, F&& f) const {
  if (places.size() <= 2) {  // a few are faster one by one
    for (const std::uint32_t place : places) f(at(place));
    return;
  }
  const TriangleBatch batch = batchOf(places);
  const VertexTriangleDistances distances(m_point, batch, places.size());
  for (std::size_t i = 0; i < places.size(); ++i)
    f(nearOf(places[i], distances[i], distances.reach(i)));
}

bool PointDistances::isNearer(const Near& one, const Near& two) const {
  const double difference = one.distance - two.distance;
  if (std::abs(difference) > one.error + two.error) return difference < 0;
  const Triangle &first = m_geometry.tree.ordered()[one.place],
                 &second = m_geometry.tree.ordered()[two.place];
  if (!isTapered(first) && !isTapered(second) &&
      verticesOf(first, one.closest.feature) == verticesOf(second, two.closest.feature))
    return one.element < two.element;
  const Positions& now = m_geometry.mesh.now;
  const Eigen::Vector3d corners[] = {now[first[0]],  now[first[1]],  now[first[2]],
                                     now[second[0]], now[second[1]], now[second[2]]};
  const int order = exact::compareDistances(
      m_point, {corners[0], corners[1], corners[2], one.closest.feature, radiiOf(first)},
      {corners[3], corners[4], corners[5], two.closest.feature, radiiOf(second)});
  return order < 0 || (order == 0 && one.element < two.element);
}

bool PointDistances::isWithin(const Near& near, double distance) const {
  const double difference = near.distance - distance;
  if (std::abs(difference) > near.error + kNearestSlack * distance) return difference < 0;
  if (std::isinf(distance)) return true;
  const Triangle& corners = m_geometry.tree.ordered()[near.place];
  const Positions& now = m_geometry.mesh.now;
  const Eigen::Vector3d a = now[corners[0]], b = now[corners[1]], c = now[corners[2]];
  return exact::compareDistance(m_point, {a, b, c, near.closest.feature, radiiOf(corners)},
                                distance) <= 0;
}

bool PointDistances::isTapered(const Triangle& corners) const {
  const TriangleMesh& mesh = m_geometry.mesh;
  return !mesh.radii.empty() && mesh.radii[corners[0]] != mesh.radii[corners[1]];
}

Eigen::Vector3d PointDistances::radiiOf(const Triangle& corners) const {
  const TriangleMesh& mesh = m_geometry.mesh;
  return {mesh.radius(corners[0]), mesh.radius(corners[1]), mesh.radius(corners[2])};
}

SurfacePoint PointDistances::surfacePoint(const Near& near) const {
  return {m_geometry.id,
          near.element,
          m_geometry.tree.ordered()[near.place],
          near.closest.weights,
          m_point - near.closest.difference,
          near.distance,
          surfaceNormal(m_geometry, near.element, near.closest.weights, near.closest.difference)};
}

float PointDistances::boundOf(double distance) const {
  // The search bounds distances to centre lines and points. Distances are rounded after the radius
  // was subtracted.
  const double radius = m_geometry.mesh.largestRadius;
  return OutwardRounding::up((distance + radius + kNearestError * radius) *
                             m_geometry.tree.frame().scale * (1 + kNearestError));
}

template <class Bound, class Test>
void PointDistances::forCandidates(std::size_t count, Bound&& bound, Test&& test) const {
  forNearCandidates(m_search, bound(), count, [&](const NearCandidate* all, std::size_t size) {
    std::array<std::uint32_t, TriangleBatch::kSize> places;
    for (std::size_t i = 0; i < size;) {
      const float most = bound() + m_search.tolerance;
      std::size_t some = 0;
      for (; i < size && some < places.size(); ++i)
        if (!(all[i].lower > most)) places[some++] = all[i].place;
      test(std::span<const std::uint32_t>(places).first(some));
    }
    return bound();
  });
}

template <class F>
void PointDistances::search(double most, std::size_t count, F&& f) const {
  const auto take = [&](const Near& near) { most = f(near, most); };
  if (m_bruteForce)
    for (std::uint32_t place = 0; place < m_geometry.tree.ordered().size(); ++place)
      take(at(place));
  else
    forCandidates(
        count, [&] { return boundOf(most); },
        [&](std::span<const std::uint32_t> places) { forEach(places, take); });
}

std::optional<PointDistances::Near> PointDistances::nearest(double maxDistance,
                                                            std::uint32_t likely,
                                                            double bound) const {
  PALPATE_ASSERT(maxDistance >= 0.0 && bound >= 0.0);
  std::optional<Near> best;
  const auto take = [&](const Near& near, double most) {
    if (best ? near.place != best->place && isNearer(near, *best) : isWithin(near, maxDistance))
      best = near;
    return best ? std::min(most, best->distance) : most;
  };
  double most = std::min(maxDistance, bound);
  if (likely < m_geometry.tree.ordered().size())
    forEach({&likely, 1}, [&](const Near& near) { most = take(near, most); });
  search(most, 1, take);
  return best;
}

PointDistances::RoughlyNear PointDistances::roughlyNearest(
    double tolerance, std::span<const std::uint32_t> likely) const {
  PALPATE_ASSERT(m_geometry.mesh.radii.empty() && !m_bruteForce && tolerance >= 0.0);
  PALPATE_ASSERT(likely.size() <= TriangleBatch::kSize);
  RoughlyNear best{kInfinity, 0};
  double lower = kInfinity, upper = kInfinity;
  const auto test = [&](std::span<const std::uint32_t> places) {
    if (places.empty()) return;
    const DistanceBounds bounds(m_point, batchOf(places), places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
      lower = std::min(lower, bounds.lower[i]);
      if (!(bounds.distance[i] < best.distance)) continue;
      best = {bounds.distance[i], places[i]};
      upper = bounds.distance[i] + bounds.error[i];
    }
  };
  test(likely);
  forCandidates(
      1, [&] { return boundOf(upper); }, test);
  if (best.distance - lower <= tolerance) return best;
  const auto exact = nearest(kInfinity, best.place);
  PALPATE_ASSERT(exact.has_value());
  return {exact->distance, exact->place};
}

// Sums of magnitudes are lengths or more, and do not underflow.
double PointDistances::Last::boundAt(const Eigen::Vector3d& point) const {
  return (m_distance + m_error + (point - m_point).cwiseAbs().sum()) * (1.0 + kNearestError);
}

bool PointDistances::Last::isOnSideOf(const PointDistances& distances, const Near& nearest) const {
  // Infinity less infinity is NaN, with which the comparison is false.
  return (distances.m_point - m_point).cwiseAbs().sum() * (1.0 + kNearestError) <
         (m_distance - m_error) + (nearest.distance - nearest.error);
}

void PointDistances::Last::set(const PointDistances& distances, const Near& nearest) {
  // A radius that changes along a segment changes with the closest point, which may move further.
  if (distances.m_geometry.mesh.largestRadius > 0) return;
  m_point = distances.m_point;
  m_distance = nearest.distance;
  m_error = nearest.error;
}

void PointDistances::nearest(std::size_t k, double maxDistance, std::vector<Near>& out) const {
  PALPATE_ASSERT(k > 0);
  out.clear();
  bool isHeap = false;  // made when more than k elements come
  const auto isNearerThan = [&](const Near& a, const Near& b) { return isNearer(a, b); };
  search(maxDistance, k, [&](const Near& near, double most) {
    if (out.size() < k) {
      if (isWithin(near, maxDistance)) out.push_back(near);
      if (out.size() < k) return most;
      double furthest = -kInfinity;
      for (const Near& each : out) furthest = std::max(furthest, each.distance);
      return std::min(most, furthest);
    }
    if (!isHeap) std::make_heap(out.begin(), out.end(), isNearerThan);
    isHeap = true;
    if (isNearer(near, out.front())) {
      std::pop_heap(out.begin(), out.end(), isNearerThan);
      out.back() = near;
      std::push_heap(out.begin(), out.end(), isNearerThan);
    }
    return std::min(most, out.front().distance);
  });
  std::sort(out.begin(), out.end(), isNearerThan);
}

void PointDistances::within(double distance, std::vector<std::uint32_t>& elements) const {
  PALPATE_ASSERT(distance >= 0);
  search(distance, 0, [&](const Near& near, double most) {
    if (isWithin(near, distance)) elements.push_back(near.element);
    return most;
  });
}

}  // namespace palpate
