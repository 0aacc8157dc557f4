#pragma once

#include <palpate/SpatialQueries.h>

#include "Math/RayTriangle.h"
#include "Queries/RayTraversal.h"
#include "Queries/SearchableGeometry.h"

#include <cstddef>
#include <cstdint>
#include <optional>
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

  /// bruteForce: every element is tested. scratch: kept by the caller.
  RayHits(const SearchableGeometry&, const Ray&, bool bruteForce, std::vector<Met>& scratch);

  /// t: the search ends where hits beyond it begin.
  std::optional<RayHit> first(double t);
  bool any();
  /// All hits by ascending t. out: hits are appended.
  void all(std::vector<RayHit>& out);

 private:
  enum class Wanted { First, Any, All };

  /// Fills m_met. First: with all elements of the part that begins first, if that part does not
  /// reach beyond `atLeast` or the result. Returns how far it reaches, or atLeast.
  double collect(Wanted, double tMax, double atLeast);
  /// Calls f(interval) for what the ray shares with an element.
  template <class F>
  void intersect(std::uint32_t place, F&& f) const;
  int compare(const Met&, bool lastOfFirst, const Met&, bool lastOfSecond) const;
  RayHit hitOf(const Met&, double t, bool frontFace, bool crosses) const;
  /// Calls f(hit) for the hits by ascending t, until f returns false.
  template <class F>
  void forEachHit(F&& f);
  template <class F>
  bool hitsOfPart(std::size_t begin, std::size_t end, std::size_t furthest, F&& f) const;

  const SearchableGeometry& m_geometry;
  const RaySegment m_ray;
  const bool m_bruteForce;
  const bool m_isSolid;  ///< lines and points with radii
  std::vector<Met>& m_met;
};

}  // namespace palpate
