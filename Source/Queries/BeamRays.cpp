#include "Queries/BeamRays.h"

#include <algorithm>
#include <limits>

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

BeamRays::BeamRays(const Body& geometry) : m_frame(geometry), m_zero(geometry.tree.frame().origin) {
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

std::size_t BeamRays::start(std::span<const Ray> rays) {
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
std::optional<BeamRays::Line> BeamRays::lineOf(const Ray& ray) {
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
bool BeamRays::isLongEnough(const Line& line) {
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
bool BeamRays::add(const Ray& ray) {
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
  m_ends[i] = OutwardRounding::up(std::min(line->end + slack, m_end));
  for (std::size_t k = 0; k < 2; ++k) {
    m_beam.origin[k][i] =
        m_frame.unit() * line->at(k, m_begin) + m_zero[static_cast<Eigen::Index>(m_beam.axes[k])];
    m_beam.slope[k][i] = m_beam.sign * line->slope[k];
  }
  return true;
}

void BeamRays::finish() {
  m_beam.used = (1u << m_count) - 1;
  m_beam.begin = static_cast<float>(m_begin);
  m_beam.end =
      *std::max_element(m_ends.begin(), m_ends.begin() + static_cast<std::ptrdiff_t>(m_count));
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
  const double unit = m_frame.unit(), most = unit * (kFurthestAside + 2.0) * m_extent;
  m_beam.height = unit * m_beam.sign * m_begin + m_zero[static_cast<Eigen::Index>(m_beam.axes[2])];
  const double error = unit * (m_slack - kFloatRayError * m_extent) +
                       kPlacedPointError * (most + m_zero.cwiseAbs().maxCoeff());
  m_beam.error = most < kLargestModerate ? 80.0 * most * error + kUnderflowGuard : kInfinity;
}

}  // namespace palpate
