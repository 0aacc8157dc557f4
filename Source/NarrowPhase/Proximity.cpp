#include "NarrowPhase/Proximity.h"

#include "Contact/DistinctLines.h"
#include "Contact/DistinctVertices.h"
#include "Contact/Filters.h"
#include "NarrowPhase/OwnedTests.h"
#include "NarrowPhase/SharedVertex.h"
#include "NarrowPhase/StepCheck.h"
#include "Contact/TouchNormal.h"
#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Tests vertices of one mesh against triangles of the other mesh, or of the same one.
class VertexTriangleFinder {
 public:
  VertexTriangleFinder(const MeshPair& pair, bool swapped, ContactBuffers& out)
      : m_pair(pair),
        m_features{swapped ? pair.b : pair.a, swapped ? pair.a : pair.b},
        m_swapped(swapped),
        m_vertices(m_features.first.now),
        m_positions(m_features.second.now),
        m_topology(m_features.second.topology),
        m_thickness(pair.thicknessAtEnd()),
        m_distinct(pair, swapped),
        m_check(pair, out),
        m_buffers(out),
        m_exactDecisions(out.exactDecisions) {}

  void test(std::uint32_t vertex, std::uint32_t triangle) {
    const Triangle& corners = m_topology.elements[triangle];
    const Vector3d p = m_vertices[vertex];
    const VertexTriangleDistance answer = finiteVertexTriangleDistance(
        p, m_positions[corners[0]], m_positions[corners[1]], m_positions[corners[2]]);
    m_exactDecisions += answer.exact;
    const double gap = answer.distance - m_pair.largestRadii(vertex, corners, m_swapped);
    if (!(gap <= m_thickness)) return;
    m_check.recordDistance(gap);
    if (m_check.addImpactIfTouched(m_features, vertex, triangle, m_swapped, gap)) return;
    const double radii = m_pair.radii(vertex, corners, answer.weights, m_swapped);
    if (!(answer.distance - radii <= m_thickness)) return;
    if (rejectsVertex(m_pair, vertex, triangle, m_swapped)) return;
    const MeshFeature feature = featureOf(m_topology, triangle, answer.feature);
    if (m_pair.reportsDistinct() && !m_distinct.reports(vertex, triangle, feature)) return;
    if (pointsInwardAtEnd(m_pair, vertex, feature, answer, m_swapped)) {
      if (m_pair.step.reportsImpacts)
        addImpact(m_pair, m_features, vertex, triangle, m_swapped, m_buffers);
      return;
    }
    addAtEnd(m_pair, vertex, triangle, m_swapped, answer, radii, m_buffers);
  }

 private:
  const MeshPair& m_pair;
  const Features<ImpactQuery::Kind::VertexTriangle> m_features;
  const bool m_swapped;
  const Positions &m_vertices, &m_positions;
  const MeshTopology& m_topology;
  double m_thickness;
  DistinctVertices m_distinct;
  StepCheck m_check;
  ContactBuffers& m_buffers;
  std::size_t& m_exactDecisions;
};

/// Whether two edges are certainly further apart than `distance`. The function tests for a gap
/// along the coordinate axes and along a direction perpendicular to each edge; the latter separates
/// parallel edges.
bool areFurtherApart(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0, const Vector3d& q1,
                     double distance) {
  const Vector3d gap =
      (p0.cwiseMin(p1) - q0.cwiseMax(q1)).cwiseMax(q0.cwiseMin(q1) - p0.cwiseMax(p1));
  if (gap.maxCoeff() > distance) return true;
  const Vector3d u = p1 - p0, v = q1 - q0, r = p0 - q0;
  const auto separates = [&](const Vector3d& axis) {
    const double first = axis.dot(r), along = axis.dot(u), across = axis.dot(v);
    const double least = first + std::min(along, 0.0) - std::max(across, 0.0),
                 most = first + std::max(along, 0.0) - std::min(across, 0.0);
    const double error = kMotionError * axis.norm() * (r.norm() + u.norm() + v.norm());
    return std::max(least, -most) > distance * axis.norm() + error;
  };
  return separates(r - (r.dot(v) / v.squaredNorm()) * v) ||
         separates(r - (r.dot(u) / u.squaredNorm()) * u);
}

void testEdges(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB, StepCheck& check,
               ContactBuffers& out) {
  const Features<ImpactQuery::Kind::EdgeEdge> features{pair.a, pair.b};
  const auto at = [&](int i) -> Vector3d {
    return features.meshOf(i).now[features.vertices(edgeA, edgeB)[i]];
  };
  const bool distinct = pair.reportsDistinct();
  std::optional<EdgeEdgeDistance> answer;
  if (distinct) answer = crossingEdgesDistance(at(0), at(1), at(2), at(3));
  const bool isContact = answer || !distinct;
  if (!isContact && check.checkedEdgeDistance() == 0.0) return;
  if (!isContact && areFurtherApart(at(0), at(1), at(2), at(3), check.checkedEdgeDistance()))
    return;
  if (!answer) answer = finiteEdgeEdgeDistance(at(0), at(1), at(2), at(3));
  out.exactDecisions += answer->exact;
  if (!(answer->distance <= pair.thicknessAtEnd())) return;
  check.recordDistance(answer->distance);
  if (check.addImpactIfTouched(features, edgeA, edgeB, false, answer->distance)) return;
  if (!isContact || rejectsEdges(pair, edgeA, edgeB)) return;
  if (pointInwardAtEnd(pair, edgeA, edgeB, *answer)) {
    if (pair.step.reportsImpacts) addImpact(pair, features, edgeA, edgeB, false, out);
    return;
  }
  addAtEnd(pair, edgeA, edgeB, *answer, out);
}

/// Two edges, of which at least one is of a line mesh.
void testLineEdges(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB, StepCheck& check,
                   ContactBuffers& out) {
  double gap = std::numeric_limits<double>::infinity();
  const std::optional<NearbyEdges> nearby = measureEdges(pair, edgeA, edgeB, &gap);
  check.recordGap(edgeA, edgeB, gap);
  if (!nearby) return;
  out.exactDecisions += nearby->centres.exact;
  if (pair.reportsDistinct() && !areDistinct(pair, edgeA, edgeB, *nearby, out.exactDecisions))
    return;
  if (pointInwardAtEnd(pair, edgeA, edgeB, nearby->centres)) return;
  EdgeEdgeDistance centres = nearby->centres;
  turnToSeparate(Features<ImpactQuery::Kind::EdgeEdge>{pair.a, pair.b}, edgeA, edgeB, centres,
                 out.exactDecisions);
  out.edgeEdge.push_back(
      contactOf(pair.a.topology.edges[edgeA], pair.b.topology.edges[edgeB], centres));
  out.edgeEdge.back().distance = nearby->distance;
}

/// The number of set bits, for `bits` below 2^16. The baseline processor has no instruction for it.
std::size_t countOf(std::uint32_t bits) {
  PALPATE_ASSERT(bits >> 16 == 0);
  bits -= bits >> 1 & 0x5555;
  bits = (bits & 0x3333) + (bits >> 2 & 0x3333);
  bits = (bits + (bits >> 4)) & 0x0f0f;
  return (bits + (bits >> 8)) & 0x1f;
}

/// Collects batches of triangle pairs that own feature pairs, and measures the feature pairs that
/// findPossibleProximity() keeps.
class ProximityFinder {
 public:
  ProximityFinder(const MeshPair& pair, std::span<const ElementPair> candidates,
                  ContactBuffers& out)
      : m_pair(pair),
        m_out(out),
        m_check(pair, out),
        m_verticesOfA(pair, false, out),
        m_verticesOfB(pair, true, out),
        m_sharedVertex(pair.a.topology, pair.self() ? pair.floats : nullptr, candidates),
        m_tests(pair),
        m_distinct(pair.reportsDistinct() && !pair.has(GeometryType::Lines)) {}

  void find(std::span<const ElementPair> candidates) {
    for (const ElementPair& candidate : candidates) add(candidate);
    flush();
  }

 private:
  void add(const ElementPair& candidate) {
    const std::uint32_t tests = m_tests.of(candidate);
    m_out.featurePairs += countOf(tests);
    if (tests == 0 || isAlone(candidate)) return;
    m_tests.add(candidate, tests);
    if (m_tests.isFull()) flush();
  }

  bool isAlone(const ElementPair& candidate) const {
    if (!m_sharedVertex.isUsed()) return false;
    const Triangle &s = m_pair.a.topology.elements[candidate.a],
                   &t = m_pair.b.topology.elements[candidate.b];
    return m_sharedVertex.isAlone(s, t, sameCorners(s, t));
  }

  void flush() {
    m_tests.flush(m_pair.maxFeatureDistance(), m_distinct, m_check.checkedEdgeDistance(),
                  [&](const ElementPair& candidate, int test) { measure(candidate, test); });
  }

  void measure(const ElementPair& candidate, int test) {
    const MeshTopology &a = m_pair.a.topology, &b = m_pair.b.topology;
    const std::uint8_t ofA = kFeatureOfA[test], ofB = kFeatureOfB[test];
    if (ofB == kTriangle) return m_verticesOfA.test(a.elements[candidate.a][ofA], candidate.b);
    if (ofA == kTriangle) return m_verticesOfB.test(b.elements[candidate.b][ofB], candidate.a);
    std::uint32_t edgeA = a.triangleEdges[candidate.a][edgeNumber(ofA)];
    std::uint32_t edgeB = b.triangleEdges[candidate.b][edgeNumber(ofB)];
    if (m_pair.self() && b.precedes(edgeB, edgeA)) std::swap(edgeA, edgeB);
    PALPATE_ASSERT(edgeA != kNoEdge && edgeB != kNoEdge);
    if (m_pair.has(GeometryType::Lines)) return testLineEdges(m_pair, edgeA, edgeB, m_check, m_out);
    testEdges(m_pair, edgeA, edgeB, m_check, m_out);
  }

  const MeshPair& m_pair;
  ContactBuffers& m_out;
  StepCheck m_check;
  VertexTriangleFinder m_verticesOfA, m_verticesOfB;
  const SharedVertex m_sharedVertex;
  OwnedTests m_tests;
  const bool m_distinct;  ///< edges whose closest points are ends are no contacts
};

}  // namespace

void findProximity(const MeshPair& pair, std::span<const ElementPair> candidates,
                   ContactBuffers& out) {
  ProximityFinder(pair, candidates, out).find(candidates);
}

}  // namespace palpate
