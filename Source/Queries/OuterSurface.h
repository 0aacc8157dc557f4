#pragma once

#include "Queries/PointDistances.h"
#include "Bodies/Body.h"
#include "Mesh/Corners.h"
#include "Core/CountedVector.h"

#include <Eigen/Core>

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>

namespace palpate {

/// The outer surface of a closed body: the points of its surface beside which the winding number
/// is 0. Where parts of the body overlap, the surface of one is inside another, and leads nowhere.
///
/// Threads  safe from any number of threads.
class OuterSurface {
 public:
  /// L, in the world: the winding number of the body about a point; none on its surface.
  using WindingNumber = std::function<std::optional<int>(const Eigen::Vector3d&)>;

  OuterSurface(const Body&, bool bruteForce);

  /// Whether the surface point that is nearest to p is on the outer surface. number: the winding
  /// number about p, not 0.
  bool holds(const Eigen::Vector3d& p, const PointDistances::Near&, int number,
             const WindingNumber&) const;

  struct Near {
    std::uint32_t element;
    Eigen::Vector3d point;  ///< L, in the world
  };
  /// The point of the outer surface that is nearest to p: on a face or an edge of a triangle, or
  /// where two triangles intersect. Where three triangles have one common point inside all of them,
  /// it may be another one that is further away. number: as above.
  ///
  /// Cost     the first call finds all triangles that intersect, and sorts the others into outer
  ///          and inner ones. Each call then costs about a search for the nearest triangle, and a
  ///          test of those that intersect others near it. In two spheres of 12,480 triangles
  ///          together 0.2 ms a vertex, with the first call; in eight of 50,000, 20 ms.
  std::optional<Near> nearest(const Eigen::Vector3d& p, int number, const WindingNumber&) const;

 private:
  /// The common points of two triangles.
  struct Crease {
    std::uint32_t element;  ///< the lower one
    std::array<Eigen::Vector3d, 2> ends;
  };
  /// What the first search finds.
  struct Parts {
    std::unique_ptr<Body> outer;             ///< triangles on the outer surface, whole
    CountedVector<std::uint32_t> elementOf;  ///< of the body, by elements of `outer`
    CountedVector<std::uint32_t> mixed;      ///< triangles that intersect others, ascending
    CountedVector<Crease> creases;
  };
  void find(const WindingNumber&) const;
  void findCreases() const;
  CountedVector<std::uint32_t> outerTriangles(const WindingNumber&) const;
  bool isOutside(const Eigen::Vector3d& q, const Eigen::Vector3d& direction,
                 const WindingNumber&) const;
  bool holdsPoint(const Eigen::Vector3d& q, const Eigen::Vector3d& from, int number,
                  const WindingNumber&) const;
  Corners cornersOf(std::uint32_t element) const;
  double aside(const Eigen::Vector3d& p) const;

  const Body& m_geometry;
  const bool m_bruteForce;
  // std::call_once() never returns on MinGW-w64 after its function has thrown.
  mutable std::mutex m_finding;
  mutable std::atomic<bool> m_isFound = false;
  mutable Parts m_parts;
};

}  // namespace palpate
