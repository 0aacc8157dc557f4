#include "NarrowPhase/Proximity.h"

#include "Math/ClosestPoint.h"

#include <algorithm>
#include <optional>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The vertices of one mesh against the triangles of another, or of the same.
class VertexTriangleFinder {
 public:
  /// keepCorner: whether a vertex may meet a corner's vertex here, by their ids.
  enum class Corners { All, LowerVertexOnly, None };

  VertexTriangleFinder(const TriangleMesh& vertices, const TriangleMesh& triangles,
                       const PairSettings& settings, Corners corners,
                       Buffer<VertexTriangleContact>& out, std::size_t& exactDecisions)
      : m_vertices(vertices.now),
        m_positions(triangles.now),
        m_topology(triangles.topology),
        m_self(&vertices == &triangles),
        m_thickness(settings.thickness),
        m_distinct(settings.contacts == Contacts::Distinct),
        m_corners(corners),
        m_out(out),
        m_exactDecisions(exactDecisions) {}

  void test(std::uint32_t vertex, std::uint32_t triangle) {
    const Triangle& corners = m_topology.triangles[triangle];
    const Vector3d& p = m_vertices[vertex];
    const VertexTriangleDistance answer = finiteVertexTriangleDistance(
        p, m_positions[corners[0]], m_positions[corners[1]], m_positions[corners[2]]);
    m_exactDecisions += answer.exact;
    if (!(answer.distance <= m_thickness)) return;
    if (m_distinct &&
        !isDistinct(vertex, triangle, featureOf(m_topology, triangle, answer.feature)))
      return;
    m_out.push_back(contactOf(vertex, triangle, corners, answer));
  }

 private:
  /// Whether the contact is this triangle's to report: no other triangle that holds the feature is
  /// nearer, and no lower one has its closest point on it too.
  bool isDistinct(std::uint32_t vertex, std::uint32_t triangle, const MeshFeature& feature) const {
    if (feature.kind == MeshFeature::Kind::Face) return true;
    const bool isVertex = feature.kind == MeshFeature::Kind::Vertex;
    if (isVertex && m_corners == Corners::None) return false;
    if (isVertex && m_corners == Corners::LowerVertexOnly && feature.id < vertex) return false;
    const auto holders =
        isVertex ? m_topology.vertexTriangles[feature.id] : m_topology.edgeTriangles[feature.id];
    const Vector3d& p = m_vertices[vertex];
    return std::none_of(holders.begin(), holders.end(), [&](std::uint32_t other) {
      if (other == triangle || (m_self && holdsVertex(m_topology.triangles[other], vertex)))
        return false;
      if (isVertex ? isNearerThanVertex(p, feature.id, other)
                   : isNearerThanEdge(p, feature.id, other))
        return true;
      return other < triangle && closestFeatureOf(p, other) == feature;
    });
  }

  MeshFeature closestFeatureOf(const Vector3d& p, std::uint32_t triangle) const {
    const auto& [a, b, c] = m_topology.triangles[triangle];
    return featureOf(m_topology, triangle,
                     closestTriangleFeature(p, m_positions[a], m_positions[b], m_positions[c]));
  }

  /// Whether a triangle at a vertex comes nearer to p than the vertex.
  bool isNearerThanVertex(const Vector3d& p, std::uint32_t vertex, std::uint32_t triangle) const {
    const Triangle& corners = m_topology.triangles[triangle];
    return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t other) {
      return other != vertex && comesNearer(p, m_positions[vertex], m_positions[other]);
    });
  }

  /// Whether a triangle at an edge comes nearer to p, which lies beside the edge, than the edge.
  bool isNearerThanEdge(const Vector3d& p, std::uint32_t edge, std::uint32_t triangle) const {
    const auto& sides = m_topology.triangleEdges[triangle];
    const auto side = std::find(sides.begin(), sides.end(), edge) - sides.begin();
    const Triangle& corners = m_topology.triangles[triangle];
    return liesInwards(p, m_positions[corners[side]], m_positions[corners[(side + 1) % 3]],
                       m_positions[corners[(side + 2) % 3]]);
  }

  std::span<const Vector3d> m_vertices, m_positions;
  const MeshTopology& m_topology;
  bool m_self;
  double m_thickness;
  bool m_distinct;
  Corners m_corners;
  Buffer<VertexTriangleContact>& m_out;
  std::size_t& m_exactDecisions;
};

void testEdges(const MeshPair& pair, const Segment& p, const Segment& q, bool distinct,
               ContactBuffers& out) {
  const Vector3d &p0 = pair.a.now[p[0]], &p1 = pair.a.now[p[1]];
  const Vector3d &q0 = pair.b.now[q[0]], &q1 = pair.b.now[q[1]];
  const std::optional<EdgeEdgeDistance> answer =
      distinct ? crossingEdgesDistance(p0, p1, q0, q1) : finiteEdgeEdgeDistance(p0, p1, q0, q1);
  if (!answer) return;
  out.exactDecisions += answer->exact;
  if (answer->distance <= pair.settings.thickness) out.edgeEdge.push_back(contactOf(p, q, *answer));
}

}  // namespace

void findProximity(const MeshPair& pair, std::span<const TrianglePair> candidates,
                   ContactBuffers& out) {
  using Corners = VertexTriangleFinder::Corners;
  const MeshTopology &a = pair.a.topology, &b = pair.b.topology;
  const bool distinct = pair.settings.contacts == Contacts::Distinct;
  VertexTriangleFinder ofA(pair.a, pair.b, pair.settings,
                           pair.self() ? Corners::LowerVertexOnly : Corners::All,
                           out.vertexTriangle, out.exactDecisions);
  VertexTriangleFinder ofB(
      pair.b, pair.a, pair.settings, pair.self() ? Corners::LowerVertexOnly : Corners::None,
      pair.self() ? out.vertexTriangle : out.triangleVertex, out.exactDecisions);
  for (const TrianglePair& candidate : candidates) {
    const Triangle &s = a.triangles[candidate.a], &t = b.triangles[candidate.b];
    for (int i = 0; i < 3; ++i) {
      if (a.ownsCorner(candidate.a, i) && !(pair.self() && holdsVertex(t, s[i]))) {
        ++out.featurePairs;
        ofA.test(s[i], candidate.b);
      }
      if (b.ownsCorner(candidate.b, i) && !(pair.self() && holdsVertex(s, t[i]))) {
        ++out.featurePairs;
        ofB.test(t[i], candidate.a);
      }
    }
    for (int i = 0; i < 3; ++i) {
      if (!a.ownsEdge(candidate.a, i)) continue;
      for (int j = 0; j < 3; ++j) {
        if (!b.ownsEdge(candidate.b, j)) continue;
        std::uint32_t edgeA = a.triangleEdges[candidate.a][i],
                      edgeB = b.triangleEdges[candidate.b][j];
        if (pair.self() && edgeB < edgeA) std::swap(edgeA, edgeB);
        const Segment &p = a.edges[edgeA], &q = b.edges[edgeB];
        if (pair.self() && shareVertex(p, q)) continue;
        ++out.featurePairs;
        testEdges(pair, p, q, distinct, out);
      }
    }
  }
}

}  // namespace palpate
