#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/OctreeRay.h"
#include "Queries/RayTraversal.h"
#include "Bodies/Body.h"
#include "Math/RayTriangle.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

/// The elements of one geometry that one ray meets, and the hits that follow from them.
///
/// For triangles, and for lines and points without radius, a hit is a connected part of what the
/// ray and the elements share. Lines and points with radii are solid: what they share with the ray
/// are intervals, and each end of a connected part is a hit on their surface.
class RayHits {
 public:
  /// What the ray shares with an element.
  struct Met {
    RayInterval interval;
    std::uint32_t place, element;
  };

  /// A connected part of what the ray and the elements share.
  struct Part {
    double first, last;  ///< t
    std::uint32_t entryElement,
        exitElement;  ///< elements where it begins and ends; the lowest ones there
  };

  /// bruteForce: every element is tested. scratch: kept by the caller. radius: L, of the ball whose
  /// centre moves along the ray; if it is not 0, all elements are solid and larger by it.
  RayHits(const Body&, const Ray&, bool bruteForce, std::vector<Met>& scratch, double radius = 0.0);

  /// bound: t; if the first hit is not before it, the result is no hit or one that is not before
  /// it.
  std::optional<RayHit> first(double bound);
  /// first() in three parts: startFirst(), a traversal, and endFirst(). startFirst() returns false
  /// if there is nothing to traverse.
  bool startFirst(double bound, RayTask&);
  std::optional<RayHit> endFirst(double bound);
  bool any();
  /// Number of decisions about triangles and their hits by exact arithmetic so far.
  std::size_t exactDecisions() const { return m_exactDecisions; }
  /// All hits by ascending t. out: hits are appended.
  void all(std::vector<RayHit>& out);
  /// Calls f(part) for all parts by ascending t.
  template <class F>
  void forAllParts(F&& f) {
    collect(Wanted::All, m_ray.tMax, m_ray.tMin);
    forEachPart([&](std::size_t begin, std::size_t, std::size_t furthest) {
      const Met &first = m_met[begin], &last = m_met[furthest];
      f(Part{first.interval.first, last.interval.last, first.element, last.element});
      return true;
    });
  }

 private:
  enum class Wanted { First, Any, All };

  /// Fills m_met. Elements that begin beyond both `bound` and `atLeast` may be missing. First: with
  /// all elements of the part that begins first, if that part does not reach beyond `atLeast` or
  /// the result. Returns how far it reaches, or atLeast.
  double collect(Wanted, double bound, double atLeast);
  // collect() in three parts: start(), a traversal, whose context is this object, and end().
  // start() returns as startFirst().
  bool start(Wanted, double bound, double atLeast, RayTask&);
  static float take(void* context, std::uint32_t place);  ///< TestElement
  double end();
  void add(std::uint32_t place);
  /// Calls f(interval) for what the ray shares with an element.
  template <class F>
  void intersect(std::uint32_t place, F&& f) const;
  int compare(const Met&, bool lastOfFirst, const Met&, bool lastOfSecond) const;
  RayHit hitOf(const Met&, double t, bool frontFace, bool crosses) const;
  void sort();
  /// Sorts m_met and calls f(begin, end, furthest) for its parts by ascending t, until f returns
  /// false. Entry `furthest` of a part [begin, end) ends last.
  template <class F>
  void forEachPart(F&& f) {
    sort();
    for (std::size_t begin = 0; begin < m_met.size();) {
      std::size_t furthest = begin, end = begin + 1;
      for (; end < m_met.size() && compare(m_met[end], false, m_met[furthest], true) <= 0; ++end) {
        const int order = compare(m_met[end], true, m_met[furthest], true);
        if (order > 0 || (order == 0 && m_met[end].element < m_met[furthest].element))
          furthest = end;
      }
      if (!f(begin, end, furthest)) return;
      begin = end;
    }
  }
  /// Calls f(hit) for the hits by ascending t, until f returns false.
  template <class F>
  void forEachHit(F&& f);
  template <class F>
  bool hitsOfPart(std::size_t begin, std::size_t end, std::size_t furthest, F&& f) const;

  const Body& m_geometry;
  const RaySegment m_ray;
  const bool m_bruteForce;
  const double m_radius;
  const bool m_isSolid;  ///< elements with radii
  std::vector<Met>& m_met;
  mutable std::size_t m_exactDecisions = 0;

  // Of collect():
  Wanted m_wanted;
  double m_atLeast;
  /// The part that begins first, as far as it is known, with the error of its ends. Until an
  /// element is met, it has no end before tMax.
  double m_first, m_last, m_error;
  double m_least;  ///< no element beyond this t is wanted
  OctreeRay m_inOctree;
  float m_end, m_tMax;  ///< in floats: where the ray ends, and where the traversal ends
};

/// The first hits of many rays, each as RayHits::first(tMax); `none` where there is none.
void firstHits(const Body&, std::span<const Ray>, bool bruteForce,
               std::array<std::vector<RayHits::Met>, kRaysInFlight>& scratch, const RayHit& none,
               std::span<RayHit> out);

}  // namespace palpate
