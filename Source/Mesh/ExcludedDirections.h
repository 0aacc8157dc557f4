#pragma once

#include "Mesh/TriangleMesh.h"
#include "Math/NormalCone.h"

#include <Eigen/Core>

#include <algorithm>
#include <cstdint>

namespace palpate {

/// Whether an element around a mesh's vertex {v, v}, or edge, excludes a unit direction from there
/// at a time of the step: the direction leads into the element. The order of an edge's vertices
/// changes nothing, rounding included.
inline bool excludesDirection(const TriangleMesh& mesh, const Segment& feature,
                              const Eigen::Vector3d& direction, double time) {
  const std::uint32_t p = std::min(feature[0], feature[1]), q = std::max(feature[0], feature[1]);
  const MeshTopology& topology = mesh.topology;
  const auto at = [&](std::uint32_t v) -> Eigen::Vector3d {
    return (1.0 - time) * mesh.before[v] + time * mesh.now[v];
  };
  const auto around = topology.vertexTriangles[p];
  const Eigen::Vector3d start = at(p);
  if (p != q) {
    const Eigen::Vector3d end = at(q);
    return std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
      const Triangle& corners = topology.elements[triangle];
      return std::find(corners.begin(), corners.end(), q) != corners.end() &&
             std::any_of(corners.begin(), corners.end(), [&](std::uint32_t corner) {
               return corner != p && corner != q && leadsInto(direction, start, end, at(corner));
             });
    });
  }
  // Of a closed star, each edge from p leads to the next corner of one triangle.
  const bool isClosed = topology.hasClosedStar[p] != 0;
  return std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
    const Triangle& corners = topology.elements[triangle];
    const auto leadsTo = [&](std::uint32_t corner) {
      return corner != p && leadsTowards(direction, start, at(corner));
    };
    if (isClosed) return leadsTo(corners[p == corners[0] ? 1 : p == corners[1] ? 2 : 0]);
    return std::any_of(corners.begin(), corners.end(), leadsTo);
  });
}

/// Whether a mesh's edge, or an edge at its vertex {v, v}, is a ridge or a border at the step's
/// end, as seen from a unit direction. Of an edge that is neither, two triangles lie on opposite
/// sides, and neither bends away from the direction, as seen from the other. length: of a straight
/// body on that side. thickness: of the pair.
///
/// Law      let a straight body cross edges that are no ridges, and stay a gap of at most the
///          thickness in front of the surface before the first and behind the last of them. The
///          surface between is no higher than a straight line, up to kRidgeShare of the thickness
///          for each edge, and the body stays in front of that line. So it keeps the gap over all
///          of these edges.
/// Cost     linear in the triangles around the vertex or edge.
bool hasRidge(const TriangleMesh&, const Segment& feature, const Eigen::Vector3d& direction,
              double length, double thickness);

}  // namespace palpate
