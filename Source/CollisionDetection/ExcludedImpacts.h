#pragma once

#include <palpate/CollisionData.h>

#include "Math/ClosestPoint.h"
#include "Math/NormalCone.h"
#include "NarrowPhase/NarrowPhase.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <tuple>
#include <type_traits>

namespace palpate {

/// Contacts::Distinct for impacts of lines and points: whether the elements around the features
/// that hold an impact's closest points exclude its normal.
///
/// A triangle at a closest edge or vertex excludes the direction to the other closest point if it
/// leads into the triangle: the triangle then comes nearer to the other feature. The impact is
/// excluded if the other feature has an impact with this triangle, or with one of its edges, that
/// is earlier, or as early and nearer. An impact with the triangle's interior may be up to the time
/// tolerance later, as it is never excluded. A triangle must exclude the direction at the step's
/// end as well: a surface that a solver has bent around the other feature needs all its contacts.
///
/// Laws     (1) Of all impacts the first one stays, and of equally early ones the nearest. (2) An
///          excluded impact of a vertex has an earlier or nearer one of the same vertex. (3) An
///          excluded impact of an edge has an earlier or nearer one of the same edge or of one of
///          its ends. In all three, one with a triangle's interior, at most the time tolerance
///          later, may take its place.
///
/// Impacts finds the impacts of all feature pairs. Each function returns a pointer, or null:
///   const VertexTriangleContact* ofVertex(vertex, triangle, swapped) const;
///   const EdgeEdgeContact* ofEdges(const Segment& edgeA, const Segment& edgeB) const;
/// swapped: the vertex is of MeshPair::b.
template <class Impacts>
class ExcludedImpacts {
 public:
  ExcludedImpacts(const MeshPair& pair, const Impacts& impacts)
      : m_pair(pair), m_impacts(impacts) {}

  bool contain(const VertexTriangleContact& c, bool swapped) const {
    if (c.feature == TriangleFeature::Face) return false;
    const int i = static_cast<int>(c.feature);
    const Segment feature = i < 3 ? Segment{c.corners[i], c.corners[i]}
                                  : Segment{c.corners[i - 3], c.corners[(i - 2) % 3]};
    const TriangleMesh &points = swapped ? m_pair.b : m_pair.a,
                       &mesh = swapped ? m_pair.a : m_pair.b;
    const auto standsIn = [&](std::uint32_t triangle) {
      return standsFor(m_impacts.ofVertex(c.vertex, triangle, swapped), c);
    };
    const auto atEnd = [&] {
      const Eigen::Vector3d p = mesh.now[feature[0]], q = mesh.now[feature[1]];
      return finiteVertexTriangleDistance(points.now[c.vertex], p, q, q).normal;
    };
    return anyAround(mesh, feature, c.normal, c.timeOfImpact, standsIn) &&
           isExcludedAtEnd(mesh, feature, atEnd);
  }
  bool contain(const EdgeEdgeContact& c) const {
    return isExcludedBy(m_pair.b, c.edgeB, c.featureB, c.edgeA, c.normal, c, false) ||
           isExcludedBy(m_pair.a, c.edgeA, c.featureA, c.edgeB, -c.normal, c, true);
  }

 private:
  /// swapped: the edge, which is the other one than the mesh's, is of MeshPair::b.
  bool isExcludedBy(const TriangleMesh& mesh, const Segment& ends, EdgeFeature feature,
                    const Segment& edge, const Eigen::Vector3d& direction, const EdgeEdgeContact& c,
                    bool swapped) const {
    if (!mesh.topology.hasFaces()) return false;
    const Segment closest{ends[feature == EdgeFeature::End], ends[feature != EdgeFeature::Start]};
    const auto standsIn = [&](std::uint32_t triangle) {
      const auto ofVertex = [&](std::uint32_t v) {
        return standsFor(m_impacts.ofVertex(v, triangle, swapped), c);
      };
      const auto ofEdge = [&](std::uint32_t side) {
        const Segment& other = mesh.topology.edges[side];
        return standsFor(swapped ? m_impacts.ofEdges(other, edge) : m_impacts.ofEdges(edge, other),
                         c);
      };
      const auto& sides = mesh.topology.triangleEdges[triangle];
      return std::any_of(edge.begin(), edge.end(), ofVertex) ||
             std::any_of(sides.begin(), sides.end(),
                         [&](std::uint32_t side) { return side != kNoEdge && ofEdge(side); });
    };
    const auto atEnd = [&] {
      const Positions& lines = (swapped ? m_pair.b : m_pair.a).now;
      return finiteEdgeEdgeDistance(lines[edge[0]], lines[edge[1]], mesh.now[closest[0]],
                                    mesh.now[closest[1]])
          .normal;
    };
    return anyAround(mesh, closest, direction, c.timeOfImpact, standsIn) &&
           isExcludedAtEnd(mesh, closest, atEnd);
  }

  template <class F>
  static bool isExcludedAtEnd(const TriangleMesh& mesh, const Segment& feature,
                              F&& directionAtEnd) {
    return anyAround(
        mesh, feature, directionAtEnd(), 1.0, [](std::uint32_t) { return true; }, kBentSurface);
  }
  /// Whether a direction from a vertex {v, v} or an edge leads into one of the elements around it
  /// that `f` accepts.
  template <class F>
  static bool anyAround(const TriangleMesh& mesh, const Segment& feature,
                        const Eigen::Vector3d& direction, double time, F&& f, double bend = 0.0) {
    const std::uint32_t p = feature[0], q = feature[1];
    const MeshTopology& topology = mesh.topology;
    const auto at = [&](std::uint32_t v) -> Eigen::Vector3d {
      return (1.0 - time) * mesh.before[v] + time * mesh.now[v];
    };
    const auto leadsTo = [&](std::uint32_t corner) {
      if (corner == p || corner == q) return false;
      return p == q ? leadsTowards(direction, at(p), at(corner), bend)
                    : leadsInto(direction, at(p), at(q), at(corner), bend);
    };
    const auto around =
        p == q ? topology.vertexTriangles[p]
               : topology.edgeTriangles[topology.edgeOf({std::min(p, q), std::max(p, q)})];
    return std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
      const Triangle& corners = topology.triangles[triangle];
      return std::any_of(corners.begin(), corners.end(), leadsTo) && f(triangle);
    });
  }

  template <class Found, class Contact>
  bool standsFor(const Found* found, const Contact& c) const {
    if (!found) return false;
    if constexpr (std::is_same_v<Found, VertexTriangleContact>)
      if (found->feature == TriangleFeature::Face)
        return found->timeOfImpact <= c.timeOfImpact + m_pair.settings.timeTolerance;
    return std::tie(found->timeOfImpact, found->distance) < std::tie(c.timeOfImpact, c.distance);
  }

  const MeshPair& m_pair;
  const Impacts& m_impacts;
};

/// Whether the class is for this pair: one of its meshes has lines or points.
inline bool mayExcludeImpacts(const MeshPair& pair) {
  return !(pair.a.topology.hasFaces() && pair.b.topology.hasFaces());
}

}  // namespace palpate
