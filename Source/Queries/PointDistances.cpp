#include "Queries/PointDistances.h"

#include "Math/ClosestPoint.h"
#include "Math/ExactClosestPoint.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

/// Rounded up to float.
float up(double value) { return OutwardRounding::up(static_cast<float>(value)); }

NearestSearch searchOf(const SearchableGeometry& geometry, const Eigen::Vector3d& point) {
  const FloatFrame& frame = geometry.tree.frame();
  const Positions& now = geometry.mesh.now;
  Eigen::Vector3d inBody = point;
  double error = 0.0;  // L
  if (now.isPlaced()) {
    const RigidTransform& pose = now.transform();
    inBody = pose.rotation.transpose() * (point - pose.translation);
    // Roundings of this transform and of the vertices' transform.
    error = kPlacedPointError *
            (point.cwiseAbs().sum() + pose.translation.cwiseAbs().sum() + inBody.cwiseAbs().sum());
  }
  const FloatPoint p = frame(inBody);
  const FloatBox root = geometry.tree.octree().box(0);
  float largest = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  for (int k = 0; k < 3; ++k)
    largest = std::max({largest, std::abs(root.lower[k]), std::abs(root.upper[k])});
  // Both points are off by at most 2^-24 of `largest` along each axis, and by kOrthonormal of their
  // distance. kFloatPointError has a margin. Clamped floats say nothing about a distance.
  const float slack =
      largest >= kLargestFloat
          ? std::numeric_limits<float>::infinity()
          : largest * kFloatPointError + up(error * frame.scale) + OutwardRounding::kAbsolute;
  NearestSearch search{geometry.tree.octree(), geometry.tree.floats(),
                       geometry.tree.ordered().data(), p, slack};
  if (!geometry.mesh.radii.empty()) {
    const auto [least, most] =
        std::minmax_element(geometry.mesh.radii.begin(), geometry.mesh.radii.end());
    search.tolerance = up((*most - *least) * frame.scale);
  }
  return search;
}

/// Bounds the error of a computed distance less a radius: see vertexTriangleDistance().
double errorOf(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
               const Eigen::Vector3d& c, double largestRadius) {
  const auto largest = [&](const Eigen::Vector3d& q) { return (q - p).cwiseAbs().maxCoeff(); };
  return kNearestSlack * 2 * std::max({largest(a), largest(b), largest(c), largestRadius});
}

/// The vertices of the feature that holds a closest point, ascending; unused places hold the last.
std::array<std::uint32_t, 3> featureOf(const Triangle& corners, TriangleFeature feature) {
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

PointDistances::PointDistances(const SearchableGeometry& geometry, const Eigen::Vector3d& point,
                               bool bruteForce)
    : m_geometry(geometry),
      m_point(point),
      m_bruteForce(bruteForce),
      m_search(searchOf(geometry, point)) {}

PointDistances::Near PointDistances::at(std::uint32_t place) const {
  const Triangle& corners = m_geometry.tree.ordered()[place];
  const Positions& now = m_geometry.mesh.now;
  const VertexTriangleDistance closest =
      finiteVertexTriangleDistance(m_point, now[corners[0]], now[corners[1]], now[corners[2]]);
  return {place, m_geometry.tree.octree().order()[place], closest,
          closest.distance - m_geometry.mesh.radius(corners, closest.barycentric)};
}

bool PointDistances::isNearer(const Near& one, const Near& two) const {
  const Triangle &first = m_geometry.tree.ordered()[one.place],
                 &second = m_geometry.tree.ordered()[two.place];
  const Positions& now = m_geometry.mesh.now;
  const Eigen::Vector3d corners[] = {now[first[0]],  now[first[1]],  now[first[2]],
                                     now[second[0]], now[second[1]], now[second[2]]};
  const double difference = one.distance - two.distance, radius = m_geometry.mesh.largestRadius;
  const double error = errorOf(m_point, corners[0], corners[1], corners[2], radius) +
                       errorOf(m_point, corners[3], corners[4], corners[5], radius);
  if (std::abs(difference) > error) return difference < 0;
  const int order =
      featureOf(first, one.closest.feature) == featureOf(second, two.closest.feature)
          ? 0
          : exact::compareDistances(
                m_point, {corners[0], corners[1], corners[2], one.closest.feature, radiiOf(first)},
                {corners[3], corners[4], corners[5], two.closest.feature, radiiOf(second)});
  return order < 0 || (order == 0 && one.element < two.element);
}

bool PointDistances::isWithin(const Near& near, double distance) const {
  const Triangle& corners = m_geometry.tree.ordered()[near.place];
  const Positions& now = m_geometry.mesh.now;
  const Eigen::Vector3d a = now[corners[0]], b = now[corners[1]], c = now[corners[2]];
  const double difference = near.distance - distance;
  if (std::abs(difference) >
      errorOf(m_point, a, b, c, m_geometry.mesh.largestRadius) + kNearestSlack * distance)
    return difference < 0;
  if (std::isinf(distance)) return true;
  return exact::compareDistance(m_point, {a, b, c, near.closest.feature, radiiOf(corners)},
                                distance) <= 0;
}

Eigen::Vector3d PointDistances::radiiOf(const Triangle& corners) const {
  const TriangleMesh& mesh = m_geometry.mesh;
  return {mesh.radius(corners[0]), mesh.radius(corners[1]), mesh.radius(corners[2])};
}

SurfacePoint PointDistances::surfacePoint(const Near& near) const {
  return {m_geometry.id,
          near.element,
          m_geometry.tree.ordered()[near.place],
          near.closest.barycentric,
          m_point - near.closest.difference,
          near.distance};
}

float PointDistances::boundOf(double distance) const {
  // The search bounds distances to centre lines and points. Distances are rounded after the radius
  // was subtracted.
  const double radius = m_geometry.mesh.largestRadius;
  return up((distance + radius + kNearestError * radius) * m_geometry.tree.frame().scale *
            (1 + kNearestError));
}

template <class F>
void PointDistances::search(double most, std::size_t count, F&& f) const {
  if (!m_bruteForce) {
    forNearCandidates(m_search, boundOf(most), count,
                      [&](const NearCandidate* all, std::size_t size) {
                        float bound = boundOf(most);
                        for (std::size_t i = 0; i < size; ++i) {
                          if (all[i].lower > bound + m_search.tolerance) continue;
                          most = f(all[i].place, most);
                          bound = boundOf(most);
                        }
                        return bound;
                      });
    return;
  }
  for (std::uint32_t place = 0; place < m_geometry.tree.ordered().size(); ++place)
    most = f(place, most);
}

std::optional<PointDistances::Near> PointDistances::nearest(double maxDistance,
                                                            std::uint32_t likely) const {
  std::optional<Near> best;
  const auto take = [&](std::uint32_t place, double most) {
    if (best && place == best->place) return most;
    const Near near = at(place);
    if (best ? isNearer(near, *best) : isWithin(near, maxDistance)) best = near;
    return best ? std::min(most, best->distance) : most;
  };
  double most = maxDistance;
  if (likely < m_geometry.tree.ordered().size()) most = take(likely, most);
  search(most, 1, take);
  return best;
}

void PointDistances::nearest(std::size_t k, double maxDistance, std::vector<Near>& out) const {
  out.clear();
  const auto isNearerThan = [&](const Near& a, const Near& b) { return isNearer(a, b); };
  search(maxDistance, k, [&](std::uint32_t place, double most) {
    const Near near = at(place);
    if (out.size() == k) {
      if (!isNearer(near, out.front())) return most;
      std::pop_heap(out.begin(), out.end(), isNearerThan);
      out.pop_back();
    } else if (!isWithin(near, maxDistance)) {
      return most;
    }
    out.push_back(near);
    std::push_heap(out.begin(), out.end(), isNearerThan);
    return out.size() == k ? std::min(most, out.front().distance) : most;
  });
  std::sort_heap(out.begin(), out.end(), isNearerThan);
}

void PointDistances::within(double distance, std::vector<std::uint32_t>& elements) const {
  search(distance, 0, [&](std::uint32_t place, double most) {
    const Near near = at(place);
    if (isWithin(near, distance)) elements.push_back(near.element);
    return most;
  });
}

}  // namespace palpate
