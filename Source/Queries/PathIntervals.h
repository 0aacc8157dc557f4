#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/RayHits.h"
#include "Bodies/Body.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// A polyline with the arc length of each point.
class PathLine {
 public:
  /// scratch: kept by the caller. Lengths may become infinite.
  PathLine(std::span<const Eigen::Vector3d> points, std::vector<double>& scratch);

  std::size_t segments() const { return m_points.size() - 1; }
  const Eigen::Vector3d& point(std::size_t i) const { return m_points[i]; }
  double start(std::size_t segment) const { return m_lengths[segment]; }  ///< arc length
  double length() const { return m_lengths.back(); }
  /// The arc length at a point of a segment, with t in [0, 1].
  double at(std::size_t segment, double t) const {
    const double from = m_lengths[segment], to = m_lengths[segment + 1];
    return t == 1.0 ? to : from + t * (to - from);
  }
  Eigen::Vector3d operator()(double arcLength) const;

 private:
  std::span<const Eigen::Vector3d> m_points;
  std::vector<double>& m_lengths;
};

/// A part of a path in which the ball meets a body's surface, or a place where the path may enter
/// or leave the body without meeting its surface. Arc lengths in L.
struct PathPart {
  double enter, leave;
  std::uint32_t entryElement, exitElement;  ///< elements
  bool isSurface = true;
};

/// Scratch of one path query.
struct PathScratch {
  std::vector<double> lengths;
  std::vector<PathPart> parts, backwards, inner;
  std::vector<PathInterval> inside;
  std::vector<PathClearance> outside;
  std::vector<std::uint32_t> order;  ///< of `inside`
};

/// Finds the parts of the path in which its ball meets the surface of a body with elements, by
/// ascending arc length, into scratch.parts. They do not touch each other.
void findPathParts(const Body& body, const PathLine&, double radius, bool bruteForce,
                   std::vector<RayHits::Met>& met, PathScratch&);
/// The same for a shape. Its inside belongs to the parts.
void findPathParts(const Shape&, const PathLine&, double radius, std::vector<PathPart>& parts);

/// Adds the places where the path meets faces of inverted tetrahedra to scratch.parts. The union of
/// the tetrahedra may end at a face within the mesh where both its neighbours lie on one side of
/// it: one of them is inverted. The octree over the tetrahedra must be up to date.
void addInvertedFaces(const Body& solid, const PathLine&, bool bruteForce, PointQueryStack&,
                      PathScratch&);

/// Joins parts to the intervals in which the ball is in the body, and appends them.
///
/// surfaceIsInside: parts of the surface belong to the intervals, else only what lies between parts
/// does. contains:
/// whether a point of the path between two parts is in the body.
template <class Contains>
void joinPathParts(GeometryId body, const PathLine& path, std::span<const PathPart> parts,
                   bool surfaceIsInside, Contains&& contains, std::vector<PathInterval>& out) {
  bool isOpen = false;  // out.back() goes on
  const auto add = [&](double enter, double leave, std::uint32_t entryElement,
                       std::uint32_t exitElement) {
    if (!isOpen) out.push_back({body, enter, leave, entryElement, exitElement});
    isOpen = true;
    out.back().leave = leave;
    out.back().exitElement = exitElement;
  };
  for (std::size_t i = 0; i <= parts.size(); ++i) {
    const bool isFirst = i == 0, isLast = i == parts.size();
    const double from = isFirst ? 0.0 : parts[i - 1].leave,
                 to = isLast ? path.length() : parts[i].enter;
    // The path between two parts, with the elements that it comes from and goes to.
    if ((from < to || (parts.empty() && path.length() == 0.0)) &&
        contains(path(from + 0.5 * (to - from))))
      add(from, to, isFirst ? kNoElement : parts[i - 1].exitElement,
          isLast ? kNoElement : parts[i].entryElement);
    else if (from < to || !surfaceIsInside)
      isOpen = false;
    if (!isLast && surfaceIsInside && parts[i].isSurface)
      add(parts[i].enter, parts[i].leave, parts[i].enter > 0.0 ? parts[i].entryElement : kNoElement,
          parts[i].leave < path.length() ? parts[i].exitElement : kNoElement);
  }
}

/// The least distance of the path to a body that it does not enter.
PathClearance clearanceOf(const Body& body, const PathLine&, double radius, bool bruteForce);

}  // namespace palpate
