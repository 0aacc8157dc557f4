#include "NarrowPhase/Proximity.h"

#include "NarrowPhase/StepCheck.h"
#include "Math/ClosestPoint.h"

#include <algorithm>
#include <optional>
#include <vector>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// One vertex against every triangle of a mesh, as the definition of Contacts::Distinct reads.
class VertexAgainstMesh {
 public:
  VertexAgainstMesh(const TriangleMesh& triangles, double thickness)
      : m_mesh(triangles), m_thickness(thickness) {}

  /// vertex: its id if the mesh is its own, whose triangles at the vertex are left out.
  void measure(const Vector3d& p, std::optional<std::uint32_t> vertex, ContactBuffers& out) {
    m_position = p;
    const std::vector<Triangle>& triangles = m_mesh.topology.triangles;
    m_answers.assign(triangles.size(), {});
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      if (vertex && holdsVertex(triangles[t], *vertex)) continue;
      const auto& [a, b, c] = triangles[t];
      m_answers[t] = finiteVertexTriangleDistance(p, m_mesh.now[a], m_mesh.now[b], m_mesh.now[c]);
      ++out.featurePairs;
      out.exactDecisions += m_answers[t]->exact;
    }
  }

  std::size_t size() const { return m_answers.size(); }

  /// The triangle's answer if it is within the thickness.
  const VertexTriangleDistance* near(std::uint32_t triangle) const {
    const auto& answer = m_answers[triangle];
    return answer && answer->distance <= m_thickness ? &*answer : nullptr;
  }

  MeshFeature feature(std::uint32_t triangle) const {
    return featureOf(m_mesh.topology, triangle, m_answers[triangle]->feature);
  }

  /// The lowest triangle whose closest point the feature holds, while none that holds the feature
  /// is nearer.
  bool isDistinct(std::uint32_t triangle) const {
    const MeshFeature own = feature(triangle);
    for (std::uint32_t other = 0; other < m_answers.size(); ++other) {
      if (!m_answers[other] || other == triangle) continue;
      if (feature(other) == own ? other < triangle : holds(other, own) && isNearer(other, own))
        return false;
    }
    return true;
  }

 private:
  bool holds(std::uint32_t triangle, const MeshFeature& feature) const {
    const MeshTopology& topology = m_mesh.topology;
    switch (feature.kind) {
      case MeshFeature::Kind::Vertex:
        return holdsVertex(topology.triangles[triangle], feature.id);
      case MeshFeature::Kind::Edge:
        return holdsVertex(topology.triangles[triangle], topology.edges[feature.id][0]) &&
               holdsVertex(topology.triangles[triangle], topology.edges[feature.id][1]);
      case MeshFeature::Kind::Face:
        return triangle == feature.id;
    }
    return false;
  }

  /// Whether a triangle that holds the feature, but whose closest point another feature of it
  /// holds, is nearer. One with area is: its closest point is unique. In one without area several
  /// features may hold that point.
  bool isNearer(std::uint32_t triangle, const MeshFeature& feature) const {
    const Triangle& corners = m_mesh.topology.triangles[triangle];
    const Vector3d &a = m_mesh.now[corners[0]], &b = m_mesh.now[corners[1]],
                   &c = m_mesh.now[corners[2]];
    if (hasArea(a, b, c)) return true;
    if (feature.kind != MeshFeature::Kind::Vertex) return false;
    const Vector3d& at = m_mesh.now[feature.id];
    return comesNearer(m_position, at, a) || comesNearer(m_position, at, b) ||
           comesNearer(m_position, at, c);
  }

  const TriangleMesh& m_mesh;
  double m_thickness;
  Vector3d m_position;
  std::vector<std::optional<VertexTriangleDistance>> m_answers;
};

/// kSecond: the vertices are the second mesh's.
template <bool kSecond>
void findVertexTriangle(const MeshPair& pair, std::span<const std::uint32_t> sample,
                        ContactBuffers& out) {
  const TriangleMesh &vertices = kSecond ? pair.b : pair.a, &triangles = kSecond ? pair.a : pair.b;
  const bool distinct = pair.settings.contacts == Contacts::Distinct;
  const Features<ImpactQuery::Kind::VertexTriangle> features{vertices, triangles};
  StepCheck check(pair, out);
  VertexAgainstMesh against(triangles, pair.thicknessAtEnd());
  for (const std::uint32_t v : sample) {
    against.measure(vertices.now[v], pair.self() ? std::optional(v) : std::nullopt, out);
    for (std::uint32_t t = 0; t < against.size(); ++t) {
      const VertexTriangleDistance* answer = against.near(t);
      if (!answer) continue;
      if (check.isAnsweredByImpact(features, v, t, kSecond, answer->distance)) continue;
      if (distinct) {
        const MeshFeature feature = against.feature(t);
        const bool isVertex = feature.kind == MeshFeature::Kind::Vertex;
        if (isVertex && (kSecond || (pair.self() && feature.id < v))) continue;
        if (!against.isDistinct(t)) continue;
      }
      const Triangle& corners = triangles.topology.triangles[t];
      check.noteTriangle(t, !kSecond, triangles.now[corners[0]], triangles.now[corners[1]],
                         triangles.now[corners[2]]);
      (kSecond ? out.triangleVertex : out.vertexTriangle)
          .push_back(contactOf(v, t, corners, *answer, pair.step.impacts ? 1.0 : 0.0));
    }
  }
}

void findEdgeEdge(const MeshPair& pair, std::span<const std::uint32_t> sample,
                  ContactBuffers& out) {
  const std::vector<Segment>&a = pair.a.topology.edges, &b = pair.b.topology.edges;
  const Features<ImpactQuery::Kind::EdgeEdge> features{pair.a, pair.b};
  StepCheck check(pair, out);
  for (const std::uint32_t i : sample) {
    for (std::uint32_t j = pair.self() ? i + 1 : 0; j < b.size(); ++j) {
      if (pair.self() && shareVertex(a[i], b[j])) continue;
      const EdgeEdgeDistance answer = finiteEdgeEdgeDistance(
          pair.a.now[a[i][0]], pair.a.now[a[i][1]], pair.b.now[b[j][0]], pair.b.now[b[j][1]]);
      ++out.featurePairs;
      out.exactDecisions += answer.exact;
      if (!(answer.distance <= pair.thicknessAtEnd()) ||
          check.isAnsweredByImpact(features, i, j, false, answer.distance))
        continue;
      const bool inside = !answer.parallel && answer.featureA == EdgeFeature::Interior &&
                          answer.featureB == EdgeFeature::Interior;
      if (pair.settings.contacts == Contacts::Distinct && !inside) continue;
      check.noteEdges(a[i], b[j]);
      out.edgeEdge.push_back(contactOf(a[i], b[j], answer, pair.step.impacts ? 1.0 : 0.0));
    }
  }
}

}  // namespace

void findProximityByBruteForce(const MeshPair& pair, const FeatureLists& features,
                               ContactBuffers& out) {
  findVertexTriangle<false>(pair, features.verticesOfA, out);
  findVertexTriangle<true>(pair, features.verticesOfB, out);
  findEdgeEdge(pair, features.edgesOfA, out);
}

}  // namespace palpate
