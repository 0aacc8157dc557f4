// Part of <palpate/SpatialQueries.h>: rays.
#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "Queries/BeamHits.h"
#include "Queries/QuerySource.h"
#include "Queries/RayHits.h"
#include "Queries/ShapeRays.h"
#include "Math/ClosestPoint.h"
#include "Math/Range.h"
#include "Math/StableLength.h"
#include "Core/Text.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

namespace palpate {

namespace {

/// The vertex and the edge of the element that are nearest to where the ray hits it. Of equally
/// near ones the first in the element's order.
Pick pickOf(const RayHit& hit, const Ray& ray, const Positions& now) {
  const Eigen::Vector3d point = ray.origin + hit.t * ray.direction;
  Pick pick{hit, hit.vertices[0], {hit.vertices[0], hit.vertices[1]}};
  double leastVertex = kInfinity, leastEdge = kInfinity;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::uint32_t p = hit.vertices[i], q = hit.vertices[(i + 1) % 3];
    if (const double distance = stableLength(now[p] - point); distance < leastVertex) {
      leastVertex = distance;
      pick.vertex = p;
    }
    const Eigen::Vector3d a = now[p], b = now[q];
    const double distance = finiteVertexTriangleDistance(point, a, b, b).distance;
    if (p != q && distance < leastEdge) {
      leastEdge = distance;
      pick.edge = {std::min(p, q), std::max(p, q)};
    }
  }
  return pick;
}

/// index: of a batch.
void checkRay(const Ray& ray, std::optional<std::size_t> index = {}) {
  const auto refuse = [&](ErrorCode code, const std::string& fault) {
    throw Error(code, (index ? "ray " + std::to_string(*index) : "the ray") + " has " + fault);
  };
  if (!isWithinRange(ray.origin) || !isWithinRange(ray.direction))
    refuse(ErrorCode::NonFinitePosition, "origin " + textOf(ray.origin) + " and direction " +
                                             textOf(ray.direction) + "; both must be " +
                                             kRangeRule);
  if (ray.direction == Eigen::Vector3d::Zero())
    refuse(ErrorCode::InvalidSettings, "a direction of length 0");
  if (!std::isfinite(ray.tMin) || !(ray.tMin <= ray.tMax))
    refuse(ErrorCode::InvalidSettings, "tMin " + textOf(ray.tMin) + " and tMax " +
                                           textOf(ray.tMax) +
                                           "; tMin must be finite and at most tMax");
}

/// The hits of rays, in scratch of one call.
class RayQuery {
 public:
  explicit RayQuery(SpatialQueries::Source& source)
      : m_loan(std::in_place, source),
        m_scratch(m_loan->operator->()),
        m_bruteForce(source.engine() == Engine::BruteForce) {}
  /// Uses the scratch of a call.
  RayQuery(SpatialQueries::Source& source, const SpatialQueries::Source::Loan& scratch)
      : m_scratch(scratch.operator->()), m_bruteForce(source.engine() == Engine::BruteForce) {}

  /// By ascending t; valid until the next call.
  const std::vector<RayHit>& all(const Body& geometry, const Ray& ray) {
    std::vector<RayHit>& hits = m_scratch->hits;
    hits.clear();
    if (geometry.shape)
      addShapeHits(geometry.id, geometry.shape->now, bounded(ray), hits);
    else
      on(geometry, ray).all(hits);
    return hits;
  }
  /// bound: as in RayHits::first().
  std::optional<RayHit> first(const Body& geometry, const Ray& ray, double bound) {
    if (!geometry.shape) return on(geometry, ray).first(bound);
    const std::vector<RayHit>& hits = all(geometry, ray);
    return hits.empty() ? std::nullopt : std::optional(hits.front());
  }
  /// out: element kNoElement where there is none.
  void first(const Body& geometry, std::span<const Ray> rays, std::span<RayHit> out) {
    const RayHit none{geometry.id, kNoElement, {}, {0, 0, 0}, kInfinity, false, false};
    if (geometry.shape) {
      for (std::size_t i = 0; i < rays.size(); ++i)
        out[i] = first(geometry, rays[i], kInfinity).value_or(none);
      return;
    }
    forBeams(
        geometry, rays,
        [&](BeamHits& beam, std::size_t begin, std::size_t) {
          beam.first([&](std::size_t i, const RayHit& hit) { out[begin + i] = hit; },
                     [&](std::size_t i) { out[begin + i] = none; },
                     [&](std::size_t i) {
                       const Ray& ray = rays[begin + i];
                       out[begin + i] = first(geometry, ray, ray.tMax).value_or(none);
                     });
        },
        [&](std::size_t begin, std::size_t count) {
          firstHits(geometry, rays.subspan(begin, count), m_bruteForce, m_scratch->metInFlight,
                    none, out.subspan(begin, count));
        });
  }
  /// Appends all hits of one ray after the other. counts: of each ray's hits.
  void all(const Body& geometry, std::span<const Ray> rays, std::vector<RayHit>& out,
           std::span<std::size_t> counts) {
    const auto single = [&](std::size_t i) {
      const std::vector<RayHit>& hits = all(geometry, rays[i]);
      out.insert(out.end(), hits.begin(), hits.end());
      counts[i] = hits.size();
    };
    forBeams(
        geometry, rays,
        [&](BeamHits& beam, std::size_t begin, std::size_t count) {
          std::fill_n(counts.begin() + static_cast<std::ptrdiff_t>(begin), count, std::size_t{0});
          beam.all(
              [&](std::size_t i, RayHit hit) {
                // Hits are in order, but each t is rounded.
                if (counts[begin + i]++ > 0) hit.t = std::max(hit.t, out.back().t);
                out.push_back(hit);
              },
              [&](std::size_t i) { single(begin + i); });
        },
        [&](std::size_t begin, std::size_t count) {
          for (std::size_t i = 0; i < count; ++i) single(begin + i);
        });
  }
  bool any(const Body& geometry, const Ray& ray) {
    return geometry.shape ? !all(geometry, ray).empty() : on(geometry, ray).any();
  }

 private:
  /// Divides rays into beams and other rays: calls beam(b, begin, count) for each beam, and
  /// others(begin, count) for the rays between them.
  template <class Beam, class Others>
  void forBeams(const Body& geometry, std::span<const Ray> rays, Beam&& beam, Others&& others) {
    std::size_t begin = 0, i = 0;
    if (!geometry.shape && !m_bruteForce) {
      BeamHits hits(geometry, m_scratch->beam);
      for (std::size_t skipped = 2; i < rays.size();) {
        const std::size_t count = hits.start(rays.subspan(i));
        if (count == 0) {  // Rays without order rarely try again.
          i += skipped *= 2;
          continue;
        }
        if (begin < i) others(begin, i - begin);
        beam(hits, i, count);
        begin = i += count;
        skipped = 2;
      }
    }
    if (begin < rays.size()) others(begin, rays.size() - begin);
  }
  RayHits on(const Body& geometry, const Ray& ray) {
    return {geometry, bounded(ray), m_bruteForce, m_scratch->met};
  }
  /// A hit beyond double's range is none.
  static Ray bounded(Ray ray) {
    ray.tMax = std::min(ray.tMax, std::numeric_limits<double>::max());
    return ray;
  }

  std::optional<SpatialQueries::Source::Loan> m_loan;
  SpatialQueries::Source::Scratch* const m_scratch;
  const bool m_bruteForce;
};

/// The first hit of all geometries. frontFacesOnly: other hits do not count.
std::optional<RayHit> firstHitOfAll(SpatialQueries::Source& source, const Ray& ray,
                                    bool frontFacesOnly) {
  RayQuery query(source);
  std::optional<RayHit> best;
  const auto take = [&](const RayHit& hit) {
    if (!best || hit.t < best->t) best = hit;
  };
  for (std::size_t i = 0; i < source.geometryCount(); ++i) {
    const Body& geometry = source.geometry(i);
    // The ray itself is not cut at the best hit, as this would change other hits.
    const auto first = query.first(geometry, ray, best ? best->t : ray.tMax);
    if (!first || (best && !(first->t < best->t))) continue;
    if (!frontFacesOnly) {
      take(*first);
      continue;
    }
    for (const RayHit& hit : query.all(geometry, ray))
      if (hit.frontFace) take(hit);
  }
  return best;
}

}  // namespace

std::optional<RayHit> SpatialQueries::firstHit(GeometryId id, const Ray& ray) const {
  const Source::Call source(*this);
  checkRay(ray);
  const Body& geometry = source->at(id);
  return RayQuery(*source).first(geometry, ray, ray.tMax);
}

std::optional<RayHit> SpatialQueries::firstHit(const Ray& ray) const {
  const Source::Call source(*this);
  checkRay(ray);
  return firstHitOfAll(*source, ray, false);
}

bool SpatialQueries::anyHit(GeometryId id, const Ray& ray) const {
  const Source::Call source(*this);
  checkRay(ray);
  const Body& geometry = source->at(id);
  return RayQuery(*source).any(geometry, ray);
}

std::optional<Pick> SpatialQueries::pick(const Ray& ray, bool frontFacesOnly) const {
  const Source::Call source(*this);
  checkRay(ray);
  const auto hit = firstHitOfAll(*source, ray, frontFacesOnly);
  if (!hit) return {};
  if (hit->element == kNoElement) return Pick{*hit, kNoElement, {kNoElement, kNoElement}};
  return pickOf(*hit, ray, source->at(hit->geometry).mesh.now);
}

void SpatialQueries::firstHits(GeometryId id, std::span<const Ray> rays,
                               std::span<RayHit> out) const {
  const Source::Call source(*this);
  checkSizes(rays.size(), out.size(), "rays");
  for (std::size_t i = 0; i < rays.size(); ++i) checkRay(rays[i], i);
  const Body& geometry = source->at(id);
  forParts(*source, rays.size(), [&](std::size_t begin, std::size_t end) {
    RayQuery(*source).first(geometry, rays.subspan(begin, end - begin),
                            out.subspan(begin, end - begin));
  });
}

void SpatialQueries::allHits(GeometryId id, const Ray& ray, std::vector<RayHit>& out) const {
  const Source::Call source(*this);
  checkRay(ray);
  const Body& geometry = source->at(id);
  RayQuery query(*source);
  const std::vector<RayHit>& hits = query.all(geometry, ray);
  out.reserve(hits.size());  // nothing below throws
  out.assign(hits.begin(), hits.end());
}

void SpatialQueries::allHits(GeometryId id, std::span<const Ray> rays, std::vector<RayHit>& out,
                             std::vector<std::size_t>& begins) const {
  // Parts are merged in turns, while their hits are in the caches.
  constexpr std::size_t kPartsInTurn = 64;
  const Source::Call source(*this);
  for (std::size_t i = 0; i < rays.size(); ++i) checkRay(rays[i], i);
  const Body& geometry = source->at(id);
  const Source::Loan scratch(*source);
  scratch->hitsOfParts.resize(kPartsInTurn + 1);
  std::vector<RayHit>& hits = scratch->hitsOfParts.back();
  std::vector<std::size_t>& ends = scratch->begins;  // of each ray, after a 0
  hits.clear();
  ends.assign(rays.size() + 1, 0);
  const std::span<std::size_t> counts = std::span(ends).subspan(1);
  const Source::Workers workers(*source);
  const Threads& threads = workers;
  if (threads.count() == 1) RayQuery(*source, scratch).all(geometry, rays, hits, counts);
  for (std::size_t begin = threads.count() == 1 ? rays.size() : 0, size; begin < rays.size();
       begin += size) {
    size = std::min(rays.size() - begin, kPartsInTurn * kPartOfBatch);
    threads.forChunks(size, kPartOfBatch, [&](std::size_t part, std::size_t from, std::size_t to) {
      scratch->hitsOfParts[part].clear();
      RayQuery(*source).all(geometry, rays.subspan(begin + from, to - from),
                            scratch->hitsOfParts[part], counts.subspan(begin + from, to - from));
    });
    for (std::size_t part = 0; part * kPartOfBatch < size; ++part) {
      const std::vector<RayHit>& some = scratch->hitsOfParts[part];
      hits.insert(hits.end(), some.begin(), some.end());
    }
  }
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  out.swap(hits);
  begins.swap(ends);
}

}  // namespace palpate
