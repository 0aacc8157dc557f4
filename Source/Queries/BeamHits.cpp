#include "Queries/BeamHits.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace palpate {

BeamHits::BeamHits(const Body& geometry, Scratch& scratch)
    : m_geometry(geometry),
      m_scratch(scratch),
      m_ordered(geometry.tree.ordered().data()),
      m_positions(geometry.mesh.now.body().data()),
      m_rays(geometry) {}

std::size_t BeamHits::start(std::span<const Ray> rays) {
  const std::size_t count = m_rays.start(rays);
  for (std::size_t i = 0; i < count; ++i) {
    m_wanted[i] = m_rays.end(i);
    m_isLeft[i] = false;
    m_first[i] = m_second[i] = m_firstMet[i].t = kInfinity;
    m_error[i] = 0;
  }
  return count;
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
  traverseBeam(m_geometry.tree.octree(), m_rays.beam(), {m_ordered, m_positions}, first, call);
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
      m_wanted[ray] = std::min(m_wanted[ray], m_rays.upper(ray, met.t + met.error));
    }
  }
  return first ? *std::max_element(m_wanted.begin(),
                                   m_wanted.begin() + static_cast<std::ptrdiff_t>(m_rays.count()))
               : m_rays.beam().end;
}

/// Sorts the hits by ray and t, without those of rays that are left to RayHits.
void BeamHits::sort() {
  m_ends.fill(0);
  for (const Met& met : m_scratch.met) ++m_ends[met.ray];
  std::size_t total = 0;
  for (std::size_t i = 0; i < m_rays.count(); ++i) total += std::exchange(m_ends[i], total);
  std::vector<Met>& sorted = m_scratch.sorted;
  sorted.resize(total);
  for (const Met& met : m_scratch.met) sorted[m_ends[met.ray]++] = met;
  std::size_t begin = 0, kept = 0;
  for (std::size_t i = 0; i < m_rays.count(); ++i) {
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
