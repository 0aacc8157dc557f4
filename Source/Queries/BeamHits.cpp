#include "Queries/BeamHits.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Fewer rays search faster one by one.
constexpr std::size_t kLeastRays = 4;
/// The beam's width on both axes, each in edges and plus one, multiplied. It bounds the triangles
/// that the beam meets at once. Any value will do.
constexpr double kMostEdges = 40;
/// Shares of the octree's extent: how much longer than its rays a beam is, how much of that covers
/// rounding, and the shortest beam.
constexpr double kLonger = 1.0 / 16, kMargin = 1.0 / 64, kShortest = 1.0 / 8;
/// In extents: how far from the octree's zero the rays of a beam may be at its ends.
constexpr double kFurthestAside = 4;

}  // namespace

BeamHits::BeamHits(const Body& geometry, Scratch& scratch)
    : m_geometry(geometry),
      m_scratch(scratch),
      m_frame(geometry),
      m_ordered(geometry.tree.ordered().data()),
      m_positions(geometry.mesh.now.body().data()) {
  const std::size_t elements = geometry.tree.ordered().size();
  m_hasBeams =
      elements > 0 && geometry.mesh.topology.hasFaces() && geometry.mesh.largestRadius == 0;
  if (!m_hasBeams) return;
  m_extent = geometry.tree.octree().box(0).reach();
  m_hasBeams = m_extent < kLargestFloat && m_extent > 0x1p-80;
  m_frameError = m_frame.error() + (geometry.isPlaced() ? 4.0 * kOrthonormal * m_extent : 0.0);
  // For triangles of one size on a sphere.
  m_perEdge = std::sqrt(static_cast<double>(elements)) / (5.4 * m_extent);
}

std::size_t BeamHits::start(std::span<const Ray> rays) {
  m_count = 0;
  if (!m_hasBeams || rays.size() < kLeastRays) return 0;
  // Rays without order mostly end here. False where a product overflows, too.
  const Vector3d &d = rays[0].direction, &e = rays[kLeastRays - 1].direction;
  const double along = d.dot(e);
  if (!(along > 0 && along * along >= 0.75 * d.squaredNorm() * e.squaredNorm())) return 0;
  while (m_count < std::min(kSize, rays.size()) && add(rays[m_count])) continue;
  if (m_count < kLeastRays) return m_count = 0;
  finish();
  return m_count;
}

/// The ray's line in the octree's floats. None if the ray does not advance on the beam's axis.
std::optional<BeamHits::Line> BeamHits::lineOf(const Ray& ray) {
  const Vector3d origin = m_frame.toFrame(ray.origin), direction = m_frame.turned(ray.direction);
  const double largest = direction.cwiseAbs().maxCoeff();
  if (m_count == 0) {
    Eigen::Index axis;
    direction.cwiseAbs().maxCoeff(&axis);
    m_beam.axes[2] = static_cast<std::size_t>(axis);
    m_beam.axes[0] = (m_beam.axes[2] + 1) % 3;
    m_beam.axes[1] = (m_beam.axes[2] + 2) % 3;
    m_beam.sign = direction[axis] < 0 ? -1.0f : 1.0f;
  }
  const auto on = [&](const Vector3d& v, std::size_t k) {
    return v[static_cast<Eigen::Index>(m_beam.axes[k])];
  };
  const double along = m_beam.sign * on(direction, 2), perT = along * m_frame.scale(),
               perAlong = 1.0 / along, atZero = m_beam.sign * on(origin, 2),
               toMin = ray.tMin * perT, toMax = ray.tMax * perT;
  // These comparisons are false for NaN.
  if (!(along >= 0.5 * largest && perT >= 0x1p-900 && perT <= 0x1p900)) return {};
  return Line{{on(origin, 0), on(origin, 1)},
              {on(direction, 0) * perAlong, on(direction, 1) * perAlong},
              atZero,
              perT,
              atZero + toMin - kPlacedPointError * std::abs(toMin),
              atZero + toMax + kPlacedPointError * std::abs(toMax),
              origin.cwiseAbs().maxCoeff() + m_extent};
}

/// Whether the beam is as long as the part of the ray within the octree. The first ray says how
/// long it is.
bool BeamHits::isLongEnough(const Line& line) {
  const double most = (1.0 + kLonger) * m_extent, margin = kMargin * m_extent;
  if (m_count == 0) {
    m_begin = static_cast<float>(std::max(-most, line.begin - kLonger * m_extent));
    m_end = static_cast<float>(std::min(most, line.end + kLonger * m_extent));
  }
  return m_end - m_begin >= kShortest * m_extent &&
         (line.begin >= m_begin + margin || m_begin <= -m_extent - margin) &&
         (line.end <= m_end - margin || m_end >= m_extent + margin);
}

/// Adds a ray to the beam, or returns false if it goes another way.
bool BeamHits::add(const Ray& ray) {
  const auto line = lineOf(ray);
  if (!line || !isLongEnough(*line)) return false;
  // With the extent E, the lines are within 4 E, and between their ends w grows by 2.2 E. In floats
  // a line errs by at most 32 roundings of E, less than kFloatRayError. The rest are errors of the
  // ray's line in double: those of the origin on three axes, on two of them by slopes up to 2.
  const double slack = kFloatRayError * m_extent + kPlacedPointError * line->reach +
                       3.0 * m_frameError + OutwardRounding::kAbsolute;
  if (!(slack <= kMargin * m_extent)) return false;
  Sides lower, upper;
  double edges = 1;
  for (std::size_t k = 0; k < 2; ++k) {
    for (const std::size_t i : {0, 1}) {
      const double at = line->at(k, i == 0 ? m_begin : m_end);
      if (!(std::abs(at) <= kFurthestAside * m_extent)) return false;
      lower[k][i] = m_count == 0 ? at : std::min(m_lower[k][i], at);
      upper[k][i] = m_count == 0 ? at : std::max(m_upper[k][i], at);
    }
    edges *= 1 + std::max(upper[k][0] - lower[k][0], upper[k][1] - lower[k][1]) * m_perEdge;
  }
  if (!(edges <= kMostEdges)) return false;
  m_lower = lower;
  m_upper = upper;
  m_slack = m_count == 0 ? slack : std::max(m_slack, slack);

  const std::size_t i = m_count++;
  m_rays[i] = {ray.origin, ray.direction, ray.tMin,
               std::min(ray.tMax, std::numeric_limits<double>::max())};
  m_perT[i] = line->perT;
  m_atZero[i] = line->atZero;
  m_isLeft[i] = false;
  m_wanted[i] = OutwardRounding::up(std::min(line->end + slack, m_end));
  m_first[i] = m_second[i] = m_firstMet[i].t = kInfinity;
  m_error[i] = 0;
  const Vector3d& zero = m_geometry.tree.frame().origin;
  for (std::size_t k = 0; k < 2; ++k) {
    m_beam.origin[k][i] =
        m_frame.unit() * line->at(k, m_begin) + zero[static_cast<Eigen::Index>(m_beam.axes[k])];
    m_beam.slope[k][i] = m_beam.sign * line->slope[k];
  }
  return true;
}

void BeamHits::finish() {
  m_beam.used = (1u << m_count) - 1;
  m_beam.begin = static_cast<float>(m_begin);
  m_beam.end =
      *std::max_element(m_wanted.begin(), m_wanted.begin() + static_cast<std::ptrdiff_t>(m_count));
  const double length = m_end - m_begin;
  for (std::size_t k = 0; k < 2; ++k) {
    m_beam.lower[k] = static_cast<float>(m_lower[k][0] - m_slack);
    m_beam.upper[k] = static_cast<float>(m_upper[k][0] + m_slack);
    m_beam.lowerSlope[k] = static_cast<float>((m_lower[k][1] - m_lower[k][0]) / length);
    m_beam.upperSlope[k] = static_cast<float>((m_upper[k][1] - m_upper[k][0]) / length);
    for (std::size_t i = m_count; i < kSize; ++i) m_beam.origin[k][i] = m_beam.slope[k][i] = 0;
  }
  // As for LineFilter, with slopes up to 2: a projected coordinate is at most 3 m, with an error of
  // 3 e and of 5 roundings, together at most 4 e. The cross product of two corners errs by at most
  // 4 (3 m) (4 e) + 2 (4 e)² and, for its own roundings, e m: by less than 80 e m if e is at most
  // m / 4. Otherwise no product is that large.
  const Vector3d& zero = m_geometry.tree.frame().origin;
  const double unit = m_frame.unit(), most = unit * (kFurthestAside + 2.0) * m_extent;
  m_beam.height = unit * m_beam.sign * m_begin + zero[static_cast<Eigen::Index>(m_beam.axes[2])];
  const double error = unit * (m_slack - kFloatRayError * m_extent) +
                       kPlacedPointError * (most + zero.cwiseAbs().maxCoeff());
  m_beam.error = most < kLargestModerate ? 80.0 * most * error + kUnderflowGuard : kInfinity;
}

void BeamHits::setPair(std::size_t i, std::uint32_t ray, std::uint32_t place) {
  const auto& [a, b, c] = m_ordered[place];
  if (const Positions& now = m_geometry.mesh.now; now.isPlaced())
    m_scratch.pairs.set(i, m_rays[ray], now[a], now[b], now[c]);
  else
    m_scratch.pairs.set(i, m_rays[ray], m_positions[a], m_positions[b], m_positions[c]);
}

void BeamHits::collect(bool first) {
  m_scratch.met.clear();
  auto call = [&](std::span<const RayPair> pairs) { return take(pairs, first); };
  traverseBeam(m_geometry.tree.octree(), m_beam, {m_ordered, m_positions}, first, call);
}

float BeamHits::take(std::span<const RayPair> pairs, bool first) {
  RayTriangleHits found;
  for (; !pairs.empty(); pairs = pairs.subspan(std::min(pairs.size(), RayTriangles::kSize))) {
    const std::size_t size = std::min(pairs.size(), RayTriangles::kSize);
    for (std::size_t i = 0; i < size; ++i) setPair(i, pairs[i].ray, pairs[i].place);
    intersectRays(m_scratch.pairs, found);
    for (std::size_t i = 0; i < size; ++i) {
      const std::uint32_t ray = pairs[i].ray;
      if (found.undecided >> i & 1) {
        m_isLeft[ray] = true;
        m_wanted[ray] = -std::numeric_limits<float>::infinity();
      }
      if (!(found.hits >> i & 1)) continue;
      const Met met{found.t[i], found.error[i], pairs[i].place, ray, (found.fronts >> i & 1) != 0};
      m_error[ray] = std::max(m_error[ray], met.error);
      if (!first) {
        m_scratch.met.push_back(met);
        continue;
      }
      m_second[ray] = std::min(m_second[ray], std::max(m_first[ray], met.t));
      if (!(met.t < m_first[ray])) continue;
      m_first[ray] = met.t;
      m_firstMet[ray] = met;
      const double reach = (met.t + met.error) * m_perT[ray];
      const double w = m_atZero[ray] + reach + m_slack +
                       kPlacedPointError * (std::abs(m_atZero[ray]) + std::abs(reach));
      m_wanted[ray] = std::min(m_wanted[ray], OutwardRounding::up(w));
    }
  }
  return first ? *std::max_element(m_wanted.begin(),
                                   m_wanted.begin() + static_cast<std::ptrdiff_t>(m_count))
               : m_beam.end;
}

/// Sorts the hits by ray and t, without those of rays that are left to RayHits.
void BeamHits::sort() {
  m_ends.fill(0);
  for (const Met& met : m_scratch.met) ++m_ends[met.ray];
  std::size_t total = 0;
  for (std::size_t i = 0; i < m_count; ++i) total += std::exchange(m_ends[i], total);
  std::vector<Met>& sorted = m_scratch.sorted;
  sorted.resize(total);
  for (const Met& met : m_scratch.met) sorted[m_ends[met.ray]++] = met;
  std::size_t begin = 0, kept = 0;
  for (std::size_t i = 0; i < m_count; ++i) {
    const auto from = sorted.begin() + static_cast<std::ptrdiff_t>(begin),
               to = sorted.begin() + static_cast<std::ptrdiff_t>(m_ends[i]);
    begin = m_ends[i];
    std::sort(from, to, [](const Met& a, const Met& b) { return a.t < b.t; });
    for (auto met = from; !m_isLeft[i] && met != to && met + 1 != to; ++met)
      m_isLeft[i] = !isApart(met->t, (met + 1)->t, m_error[i]);
    if (!m_isLeft[i]) {
      std::copy(from, to, sorted.begin() + static_cast<std::ptrdiff_t>(kept));
      kept += static_cast<std::size_t>(to - from);
    }
    m_ends[i] = kept;
  }
  sorted.resize(kept);
}

RayHit BeamHits::hitOf(const Met& met, const RayPoints& points, std::size_t i) const {
  const Triangle& corners = m_ordered[met.place];
  RayHit hit{m_geometry.id, m_geometry.tree.octree().order()[met.place],
             corners,       {points.weights[0][i], points.weights[1][i], points.weights[2][i]},
             points.t[i],   met.frontFace,
             true};
  if (points.decided >> i & 1) return hit;
  const Positions& now = m_geometry.mesh.now;
  const std::int8_t crossing = met.frontFace ? -1 : 1;
  const RayPoint at =
      firstPoint(m_rays[met.ray], {met.t, met.t, met.error, crossing, met.frontFace},
                 now[corners[0]], now[corners[1]], now[corners[2]]);
  hit.t = at.t;
  hit.weights = at.weights;
  return hit;
}

}  // namespace palpate
