#pragma once

#include <palpate/FeaturePairs.h>
#include <palpate/SpatialQueries.h>

#include "Queries/NearestElements.h"
#include "Bodies/OctreeFrame.h"
#include "Math/VertexTriangleDistances.h"
#include "Core/Threads.h"

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

/// Distances of one point to the elements of one geometry with an octree, and searches by them.
/// Distances of lines and points are less their radius at the closest point.
class PointDistances {
 public:
  /// An element and its closest point.
  struct Near {
    std::uint32_t place, element;  ///< in the octree's order, and its id
    VertexTriangleDistance closest;
    double distance;  ///< L, less the radius
    double error;     ///< L: bounds that of the distance
  };

  /// bruteForce: searches test every element.
  PointDistances(const Body&, const Eigen::Vector3d& point, bool bruteForce);

  Near at(std::uint32_t place) const;
  /// Whether a is nearer than b, decided exactly, or as near with a lower element.
  bool isNearer(const Near& a, const Near& b) const;
  bool isWithin(const Near&, double distance) const;  ///< decided exactly
  SurfacePoint surfacePoint(const Near&) const;

  /// The nearest element. None is further away than maxDistance. likely: the place of an element
  /// that is likely near; any place is valid. bound: L; some element is at most that far away.
  std::optional<Near> nearest(double maxDistance, std::uint32_t likely,
                              double bound = kInfinity) const;
  /// An element, and about its distance in L.
  struct RoughlyNear {
    double distance;
    std::uint32_t place;
  };
  /// The nearest triangle of a mesh without radii, for distances that need not be exact. They are
  /// off by at most `tolerance`, in L, or by 16 u of the largest coordinate difference. likely:
  /// places of at most eight triangles that are likely near.
  RoughlyNear roughlyNearest(double tolerance, std::span<const std::uint32_t> likely) const;
  /// The k nearest elements, or fewer, in the order of isNearer(). None is further away than
  /// maxDistance. out: replaced.
  void nearest(std::size_t k, double maxDistance, std::vector<Near>& out) const;
  /// Calls f(element) for each element within a distance, in any order.
  void within(double distance, std::vector<std::uint32_t>& elements) const;

  /// The last of several points, about which all is known that helps with the next one. A distance
  /// changes by at most as much as the point moves.
  class Last {
   public:
    /// L: at least the distance of a point from the nearest element.
    double boundAt(const Eigen::Vector3d& point) const;
    /// Whether certainly no element lies between the last point and this one, as the balls up to
    /// their nearest elements overlap. Both are then on the same side of a closed surface.
    bool isOnSideOf(const PointDistances&, const Near& nearest) const;
    /// nearest: of all elements.
    void set(const PointDistances&, const Near& nearest);

   private:
    Eigen::Vector3d m_point = Eigen::Vector3d::Zero();
    double m_distance = kInfinity, m_error = kInfinity;  ///< L
  };

 private:
  /// Calls f(near, most) for elements whose distance, less the radius, may be at most `most`. f
  /// returns such a bound. count: how many nearest elements are wanted; 0 for all.
  template <class F>
  void search(double most, std::size_t count, F&& f) const;
  /// Calls test(places), for up to TriangleBatch::kSize elements each, until all have been tested
  /// that may be within bound(), in the octree's floats. count: as above.
  template <class Bound, class Test>
  void forCandidates(std::size_t count, Bound&& bound, Test&& test) const;
  TriangleBatch batchOf(std::span<const std::uint32_t> places) const;
  /// Up to TriangleBatch::kSize elements, side by side. f(near): see at().
  template <class F>
  void forEach(std::span<const std::uint32_t> places, F&& f) const;
  Near nearOf(std::uint32_t place, VertexTriangleDistance, double reach) const;
  float boundOf(double distance) const;  ///< in the octree's floats
  Eigen::Vector3d radiiOf(const Triangle& corners) const;
  bool isTapered(const Triangle& corners) const;  ///< a segment whose radii differ

  const Body& m_geometry;
  const Eigen::Vector3d m_point;
  const bool m_bruteForce;
  NearestSearch m_search;
};

}  // namespace palpate
