#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/BeamRays.h"
#include "Queries/RayBeam.h"
#include "Queries/RayHits.h"
#include "Bodies/Body.h"
#include "Math/RayTriangles.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// The hits of neighbouring rays of a batch, which traverse the octree together as a RayBeam.
///
/// A ray's hits are taken from the beam if rounded arithmetic is certain of each, and of their
/// order. They then have the bits of RayHits. Other rays are left to RayHits.
class BeamHits {
 public:
  /// A triangle that a ray certainly meets, in a point.
  struct Met {
    double t, error;  ///< as in RayInterval
    std::uint32_t place, ray;
    bool frontFace;
  };
  /// Kept by the caller.
  struct Scratch {
    std::vector<Met> met, sorted;
    RayTriangles pairs;
  };

  BeamHits(const Body&, Scratch&);

  /// Makes a beam of the first rays, as BeamRays::start().
  std::size_t start(std::span<const Ray>);
  /// The first hits of the beam's rays. Calls hit(ray, hit) for each ray that has one, miss(ray)
  /// for each that has none, and other(ray) for each that is left to RayHits.
  template <class Hit, class Miss, class Other>
  void first(Hit&& hit, Miss&& miss, Other&& other) {
    collect(true);
    m_scratch.sorted.clear();
    for (std::uint32_t i = 0; i < m_rays.count(); ++i)
      if (m_isLeft[i] || !isApart(m_first[i], m_second[i], m_error[i]))
        other(i);
      else if (m_firstMet[i].t < kInfinity)
        m_scratch.sorted.push_back(m_firstMet[i]);
      else
        miss(i);
    forEachHit(m_scratch.sorted, hit);
  }
  /// All hits: the same calls, for each ray in order, and its hits by ascending t.
  template <class Hit, class Other>
  void all(Hit&& hit, Other&& other) {
    collect(false);
    sort();
    std::size_t begin = 0;
    for (std::uint32_t i = 0; i < m_rays.count(); ++i) {
      if (!m_isLeft[i]) continue;
      forEachHit(std::span(m_scratch.sorted).subspan(begin, m_ends[i] - begin), hit);
      begin = m_ends[i];
      other(i);
    }
    forEachHit(std::span(m_scratch.sorted).subspan(begin), hit);
  }

 private:
  static constexpr std::size_t kSize = RayBeam::kSize;

  /// Whether intersectRay() and its error say which of two parameters is the larger.
  static bool isApart(double first, double second, double mostError) {
    return second - first > 2.0 * mostError || second == kInfinity;
  }
  void collect(bool first);
  float take(std::span<const RayPair>, bool first);
  void sort();
  void setPair(std::size_t i, std::uint32_t ray, std::uint32_t place);
  RayHit hitOf(const Met&, const RayPoints&, std::size_t i) const;
  /// Calls f(ray, hit) for each.
  template <class F>
  void forEachHit(std::span<const Met> mets, F&& f) {
    alignas(64) double t[RayTriangles::kSize] = {}, error[RayTriangles::kSize] = {};
    RayPoints points;
    for (; !mets.empty(); mets = mets.subspan(std::min(mets.size(), RayTriangles::kSize))) {
      const std::size_t size = std::min(mets.size(), RayTriangles::kSize);
      for (std::size_t i = 0; i < size; ++i) {
        setPair(i, mets[i].ray, mets[i].place);
        t[i] = mets[i].t;
        error[i] = mets[i].error;
      }
      firstPoints(m_scratch.pairs, t, error, points);
      for (std::size_t i = 0; i < size; ++i) f(mets[i].ray, hitOf(mets[i], points, i));
    }
  }

  const Body& m_geometry;
  Scratch& m_scratch;
  const Triangle* const m_ordered;
  const Eigen::Vector3d* const m_positions;  ///< where the octree is
  BeamRays m_rays;
  // Of each ray:
  std::array<bool, kSize> m_isLeft;                      ///< to RayHits
  std::array<float, kSize> m_wanted;                     ///< the largest w that is still wanted
  std::array<double, kSize> m_first, m_second, m_error;  ///< t; the largest error
  std::array<Met, kSize> m_firstMet;
  std::array<std::size_t, kSize> m_ends;  ///< of each ray's hits in Scratch::sorted
};

}  // namespace palpate
