#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/RayBeam.h"
#include "Queries/RayHits.h"
#include "Bodies/Body.h"
#include "Bodies/OctreeFrame.h"
#include "Math/RayTriangles.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
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

  /// Makes a beam of the first rays that go the same way. Returns their number; 0 if there are too
  /// few for a beam.
  std::size_t start(std::span<const Ray>);
  /// The first hits of the beam's rays. Calls hit(ray, hit) for each ray that has one, miss(ray)
  /// for each that has none, and other(ray) for each that is left to RayHits.
  template <class Hit, class Miss, class Other>
  void first(Hit&& hit, Miss&& miss, Other&& other) {
    collect(true);
    m_scratch.sorted.clear();
    for (std::uint32_t i = 0; i < m_count; ++i)
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
    for (std::uint32_t i = 0; i < m_count; ++i) {
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
  /// A ray's line. w: as in RayBeam.
  struct Line {
    double origin[2], slope[2];  ///< on the other axes; per w
    double atZero, perT;         ///< w = atZero + t perT
    double begin, end;           ///< w of the ray's ends, at least
    double reach;                ///< of the origin's coordinates and the octree's

    double at(std::size_t k, double w) const { return origin[k] + (w - atZero) * slope[k]; }
  };
  using Sides = std::array<std::array<double, 2>, 2>;  ///< of rays: axis, at m_begin and m_end

  std::optional<Line> lineOf(const Ray&);
  bool isLongEnough(const Line&);
  bool add(const Ray&);
  void finish();
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
  const OctreeFrame m_frame;
  const Triangle* const m_ordered;
  const Eigen::Vector3d* const m_positions;  ///< where the octree is
  bool m_hasBeams;                           ///< whether the geometry can be searched by beams
  double m_extent;      ///< of the octree's root; this and what follows is in its floats
  double m_frameError;  ///< of positions, besides their share of the coordinates
  double m_perEdge;     ///< per about the mean edge of the triangles

  std::size_t m_count = 0;
  RayBeam m_beam;
  double m_begin, m_end;  ///< w between which the beam's lines are taken
  double m_slack;
  Sides m_lower, m_upper;
  // Of each ray:
  std::array<RaySegment, kSize> m_rays;
  std::array<double, kSize> m_perT, m_atZero;            ///< w = m_atZero + t m_perT
  std::array<bool, kSize> m_isLeft;                      ///< to RayHits
  std::array<float, kSize> m_wanted;                     ///< the largest w that is still wanted
  std::array<double, kSize> m_first, m_second, m_error;  ///< t; the largest error
  std::array<Met, kSize> m_firstMet;
  std::array<std::size_t, kSize> m_ends;  ///< of each ray's hits in Scratch::sorted
};

}  // namespace palpate
