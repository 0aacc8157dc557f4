#include "Contact/IntersectionContacts.h"

#include "Contact/ContactLists.h"
#include "Contact/Filters.h"
#include "Contact/TouchNormal.h"
#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <bit>

namespace palpate {

namespace {

/// Whether a direction from a feature leads below the surface, or, from an edge, below one of its
/// triangles and along the other: above the end of a tool a wall may lie in one plane with it.
bool mayBeBelow(const TriangleMesh& mesh, const MeshFeature& feature,
                const Eigen::Vector3d& direction) {
  if (liesBelow(mesh, feature, direction)) return true;
  if (feature.kind != MeshFeature::Kind::Edge) return false;
  const auto triangles = mesh.topology.edgeTriangles[feature.id];
  if (triangles.size() != 2) return false;
  double sum = 0.0;
  for (const std::uint32_t t : triangles) {
    const auto [a, b, c] = cornersOf(mesh.topology.elements[t], mesh.now);
    const double above = direction.dot(windingNormal(a, b, c));
    if (above > kTouchAngle) return false;
    sum += above;
  }
  return sum < -kTouchAngle;
}

/// The corner between two edges, given as bits.
int sharedCorner(unsigned twoEdges) {
  PALPATE_ASSERT(std::popcount(twoEdges) == 2);
  return twoEdges == 0b011 ? 1 : twoEdges == 0b110 ? 2 : 0;
}

/// Makes the contacts of two triangles that intersect.
class ContactsOfTriangles {
 public:
  ContactsOfTriangles(const MeshPair& pair, const MeshTriangle& a, const MeshTriangle& b,
                      ContactBuffers& out)
      : m_pair(pair), m_a(a), m_b(b), m_out(out), m_self(pair.self()) {}

  void addPierced(unsigned edgesOfA, unsigned edgesOfB) {
    PALPATE_ASSERT(std::popcount(edgesOfA) + std::popcount(edgesOfB) <= 2);
    if (std::popcount(edgesOfA) == 2) {
      addCornerOfA(sharedCorner(edgesOfA));
    } else if (std::popcount(edgesOfB) == 2) {
      addCornerOfB(sharedCorner(edgesOfB));
    } else if (edgesOfA != 0 && edgesOfB != 0) {
      addEdges(m_a.edge(std::countr_zero(edgesOfA)), m_b.edge(std::countr_zero(edgesOfB)));
    }
  }

  /// Returns whether the edges have crossed. Then it adds their contact.
  bool addIfCrossed(std::uint32_t edgeA, std::uint32_t edgeB) {
    sort(edgeA, edgeB);
    const EdgeEdgeDistance at = distanceOf(edgeA, edgeB);
    if (!haveCrossed(edgeA, edgeB, at)) return false;
    addEdges(edgeA, edgeB, at, true);
    return true;
  }

  void addCrossed(std::uint32_t edgeA, std::uint32_t edgeB) {
    sort(edgeA, edgeB);
    const EdgeEdgeDistance at = distanceOf(edgeA, edgeB);
    addEdges(edgeA, edgeB, at, at.distance > 0.0);
  }

  void addTouching(const TriangleIntersection& intersection) {
    const MeshTopology &topologyA = m_a.mesh.topology, &topologyB = m_b.mesh.topology;
    for (int i = 0; i < 3; ++i) {
      if (intersection.cornersOfAOnB >> i & 1 && topologyA.ownsCorner(m_a.id, i)) addCornerOfA(i);
      if (intersection.cornersOfBOnA >> i & 1 && topologyB.ownsCorner(m_b.id, i)) addCornerOfB(i);
      for (int j = 0; j < 3; ++j) {
        if (intersection.touchingEdges & TriangleIntersection::edgesBit(i, j) &&
            topologyA.ownsEdge(m_a.id, i) && topologyB.ownsEdge(m_b.id, j))
          addEdges(m_a.edge(i), m_b.edge(j));
      }
    }
  }

 private:
  void addCornerOfA(int i) { addCorner(m_a, i, m_b); }
  void addCornerOfB(int i) { addCorner(m_b, i, m_a); }

  void addCorner(const MeshTriangle& of, int corner, const MeshTriangle& triangle) {
    const bool swapped = &of == &m_b;
    if (rejectsVertex(m_pair, of.vertices[corner], triangle.id, swapped)) return;
    const auto& [a, b, c] = triangle.positions;
    VertexTriangleDistance answer = finiteVertexTriangleDistance(of.positions[corner], a, b, c);
    m_out.exactDecisions += answer.exact;
    if (answer.distance > 0.0) turnToOutside(of.positions[corner], triangle.positions, answer);
    addAtEnd(m_pair, of.vertices[corner], triangle.id, swapped, answer, 0.0, m_out);
  }

  /// Makes the distance of a vertex behind the triangle negative. At distance zero
  /// addAtEnd() finds the normal.
  void turnToOutside(const Eigen::Vector3d& p, const Corners& triangle,
                     VertexTriangleDistance& answer) {
    const auto& [a, b, c] = triangle;
    SignCounts counts;
    const bool behind = orient3d(a, b, c, p, counts) < 0;
    m_out.exactDecisions += counts.undecided;
    if (behind)
      turnToFront(triangle, answer);
    else if (answer.feature == TriangleFeature::Face)
      answer.normal = windingNormal(a, b, c);
  }

  void sort(std::uint32_t& edgeA, std::uint32_t& edgeB) const {
    if (m_self && m_pair.a.topology.precedes(edgeB, edgeA)) std::swap(edgeA, edgeB);
  }
  EdgeEdgeDistance distanceOf(std::uint32_t edgeA, std::uint32_t edgeB) const {
    const Segment &p = m_pair.a.topology.edges[edgeA], &q = m_pair.b.topology.edges[edgeB];
    const auto &positionsA = m_pair.a.now, &positionsB = m_pair.b.now;
    return finiteEdgeEdgeDistance(positionsA[p[0]], positionsA[p[1]], positionsB[q[0]],
                                  positionsB[q[1]]);
  }
  void addEdges(std::uint32_t edgeA, std::uint32_t edgeB) {
    sort(edgeA, edgeB);
    const EdgeEdgeDistance at = distanceOf(edgeA, edgeB);
    addEdges(edgeA, edgeB, at, haveCrossed(edgeA, edgeB, at));
  }
  void addEdges(std::uint32_t edgeA, std::uint32_t edgeB, EdgeEdgeDistance answer, bool crossed) {
    if (rejectsEdges(m_pair, edgeA, edgeB)) return;
    m_out.exactDecisions += answer.exact;
    if (crossed) turn(answer);
    addAtEnd(m_pair, edgeA, edgeB, answer, m_out);
  }

  bool haveCrossed(std::uint32_t edgeA, std::uint32_t edgeB, const EdgeEdgeDistance& at) const {
    return at.distance > 0.0 &&
           mayBeBelow(m_pair.b, featureOf(m_pair.b.topology, edgeB, at.featureB), at.normal) &&
           mayBeBelow(m_pair.a, featureOf(m_pair.a.topology, edgeA, at.featureA), -at.normal);
  }

  const MeshPair& m_pair;
  const MeshTriangle &m_a, &m_b;
  ContactBuffers& m_out;
  bool m_self;
};

}  // namespace

void addTouching(const MeshPair& pair, const MeshTriangle& a, const MeshTriangle& b,
                 const TriangleIntersection& intersection, ContactBuffers& out) {
  ContactsOfTriangles(pair, a, b, out).addTouching(intersection);
}

void turnToFront(const Corners& triangle, VertexTriangleDistance& answer) {
  PALPATE_ASSERT(answer.distance > 0.0);
  // At a face this is the direction of the difference, and has the same bits for every vertex.
  answer.normal = answer.feature == TriangleFeature::Face
                      ? windingNormal(triangle[0], triangle[1], triangle[2])
                      : Eigen::Vector3d(-answer.normal);
  answer.distance = -answer.distance;
}

void addPierced(const MeshPair& pair, const PiercedPair& pierced, ContactBuffers& out) {
  const MeshTriangle a(pair.a, pierced.triangles.a, pair.a.now),
      b(pair.b, pierced.triangles.b, pair.b.now);
  ContactsOfTriangles(pair, a, b, out).addPierced(pierced.edgesOfA, pierced.edgesOfB);
}

bool addIfCrossed(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB,
                  ContactBuffers& out) {
  const MeshTriangle a(pair.a, pair.a.topology.edgeTriangles[edgeA][0], pair.a.now),
      b(pair.b, pair.b.topology.edgeTriangles[edgeB][0], pair.b.now);
  return ContactsOfTriangles(pair, a, b, out).addIfCrossed(edgeA, edgeB);
}

void addCrossed(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB,
                ContactBuffers& out) {
  const MeshTriangle a(pair.a, pair.a.topology.edgeTriangles[edgeA][0], pair.a.now),
      b(pair.b, pair.b.topology.edgeTriangles[edgeB][0], pair.b.now);
  ContactsOfTriangles(pair, a, b, out).addCrossed(edgeA, edgeB);
}

}  // namespace palpate
