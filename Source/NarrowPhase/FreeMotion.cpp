#include "NarrowPhase/FreeMotion.h"

#include "Contact/Filters.h"
#include "NarrowPhase/OwnedTests.h"
#include "Math/ClosestPoint.h"
#include "Math/FreeMotion.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/AtomicLeast.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// No vertex may move further. Other threads may lower a value meanwhile: that changes nothing.
double mostFree(std::span<double> motions, std::span<const std::uint32_t> vertices) {
  double most = 0.0;
  for (const std::uint32_t v : vertices) most = std::max(most, leastSoFar(motions[v]));
  return most;
}

/// The vertices of a feature, with their positions and free motions.
struct FeatureCorners {
  RoundPoints points;
  std::array<std::uint32_t, 3> vertices;
  std::span<double> motions;

  template <class Vertices>
  FeatureCorners(const TriangleMesh& mesh, std::span<double> ofMesh, const Vertices& ids)
      : motions(ofMesh) {
    for (const std::uint32_t v : ids) {
      vertices[points.count] = v;
      points.add(mesh.now[v], mesh.radius(v));
    }
  }
  double& motion(int i) const { return motions[vertices[i]]; }
  double largestRadius() const {
    return *std::max_element(points.radii.begin(), points.radii.end());
  }
  double mostFree() const {
    return palpate::mostFree(motions, std::span(vertices).first(points.count));
  }
};

/// About the shortest vector from a triangle to a vertex; NaN where rounding leaves nothing of it.
/// Source   Ericson, Real-Time Collision Detection (2005), 5.1.5.
Vector3d shortestTo(const Vector3d& p, const std::array<Vector3d, 3>& x) {
  const Vector3d ab = x[1] - x[0], ac = x[2] - x[0], ap = p - x[0];
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return ap;
  const Vector3d bp = p - x[1];
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return bp;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return ap - d1 / (d1 - d3) * ab;
  const Vector3d cp = p - x[2];
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return cp;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return ap - d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0)
    return bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (x[2] - x[1]);
  const Vector3d normal = ab.cross(ac);
  return normal.dot(ap) / normal.squaredNorm() * normal;
}

/// The same from edge q to edge p. Source   ibidem, 5.1.9.
Vector3d shortestBetween(const std::array<Vector3d, 3>& p, const std::array<Vector3d, 3>& q) {
  const Vector3d u = p[1] - p[0], v = q[1] - q[0], r = p[0] - q[0];
  const double a = u.squaredNorm(), e = v.squaredNorm(), b = u.dot(v), c = u.dot(r), f = v.dot(r);
  const double square = a * e - b * b;
  double s = square > 0.0 ? std::clamp((b * f - c * e) / square, 0.0, 1.0) : 0.0;
  double t = (b * s + f) / e;
  if (t < 0.0 || t > 1.0) {
    t = t < 0.0 ? 0.0 : 1.0;
    s = std::clamp((b * t - c) / a, 0.0, 1.0);
  }
  return r + s * u - t * v;
}

/// A measured pair of features: the direction from q to p, the distance, and the radii there.
struct Measured {
  Vector3d direction;
  double distance, radii;
};

class FreeMotionFinder {
 public:
  FreeMotionFinder(const MeshPair& pair, double searchDistance, const FreeMotions& motions)
      : m_pair(pair),
        m_searchDistance(searchDistance),
        m_motions(motions),
        m_range(pair.settings, pair.a.largestRadius + pair.b.largestRadius),
        m_tests(pair) {}

  void find(std::span<const ElementPair> candidates) {
    for (const ElementPair& candidate : candidates) add(candidate);
    flush();
  }

 private:
  void add(const ElementPair& candidate) {
    const RoundBox &s = m_motions.boxesOfA[candidate.a], &t = m_motions.boxesOfB[candidate.b];
    if (s.isBeyond(m_searchDistance, t)) return;
    if (!m_pair.a.topology.isEnabled(candidate.a) || !m_pair.b.topology.isEnabled(candidate.b))
      return;
    const std::uint32_t tests = m_tests.of(candidate);
    if (tests == 0) return;
    const double most = std::max(mostFree(m_motions.a, m_pair.a.topology.elements[candidate.a]),
                                 mostFree(m_motions.b, m_pair.b.topology.elements[candidate.b]));
    if (Limits(*this, s, t).lowersNone(most)) return;
    m_most = std::max(m_most, most);
    m_tests.add(candidate, tests);
    if (m_tests.isFull()) flush();
  }

  /// Features beyond twice the freest vertex of the batch lower none.
  void flush() {
    m_tests.flush(m_searchDistance - m_range.reach() + 2.0 * std::exchange(m_most, 0.0), false, 0.0,
                  [&](const ElementPair& candidate, int test) { measure(candidate, test); });
  }

  /// What the boxes of two features, or of two elements, prove.
  struct Limits {
    Limits(const FreeMotionFinder& finder, const RoundBox& p, const RoundBox& q)
        : box(gapOfBoxes(p, q, finder.m_range.thickness())),
          free(finder.m_range.freeGap(box.gap, box.size)) {}

    /// Whether vertices that may move `most` are known to be no freer than along the axis.
    bool lowersNone(double most) const { return free > 0.0 && most <= 0.5 * free; }

    BoxGap box;
    double free;  ///< L: along the axis of the widest gap
  };

  void measure(const ElementPair& candidate, int test) {
    const MeshTopology &a = m_pair.a.topology, &b = m_pair.b.topology;
    const std::uint8_t ofA = kFeatureOfA[test], ofB = kFeatureOfB[test];
    if (ofB == kTriangle) return vertexTriangle(a.elements[candidate.a][ofA], candidate.b, false);
    if (ofA == kTriangle) return vertexTriangle(b.elements[candidate.b][ofB], candidate.a, true);
    edges(a.triangleEdges[candidate.a][edgeNumber(ofA)],
          b.triangleEdges[candidate.b][edgeNumber(ofB)]);
  }

  void vertexTriangle(std::uint32_t vertex, std::uint32_t triangle, bool swapped) {
    const TriangleMesh &vertices = swapped ? m_pair.b : m_pair.a,
                       &others = swapped ? m_pair.a : m_pair.b;
    if (m_pair.excludesVertex(vertex, triangle)) return;
    const Triangle& ids = others.topology.elements[triangle];
    const FeatureCorners p(vertices, swapped ? m_motions.b : m_motions.a, std::array{vertex}),
        q(others, swapped ? m_motions.a : m_motions.b, ids);
    bound(
        p, q, [&] { return shortestTo(p.points.positions[0], q.points.positions); },
        [&] { return rejectsVertex(m_pair, vertex, triangle, swapped); },
        [&]() -> Measured {
          const auto& x = q.points.positions;
          const VertexTriangleDistance answer =
              finiteVertexTriangleDistance(p.points.positions[0], x[0], x[1], x[2]);
          return {answer.normal, answer.distance,
                  m_pair.radii(vertex, ids, answer.weights, swapped)};
        });
  }

  void edges(std::uint32_t edgeA, std::uint32_t edgeB) {
    if (m_pair.self() && m_pair.a.topology.precedes(edgeB, edgeA)) std::swap(edgeA, edgeB);
    const Segment &ofA = m_pair.a.topology.edges[edgeA], &ofB = m_pair.b.topology.edges[edgeB];
    const FeatureCorners p(m_pair.a, m_motions.a, ofA), q(m_pair.b, m_motions.b, ofB);
    bound(
        p, q, [&] { return shortestBetween(p.points.positions, q.points.positions); },
        [&] { return rejectsEdges(m_pair, edgeA, edgeB); },
        [&]() -> Measured {
          const auto &x = p.points.positions, &y = q.points.positions;
          const EdgeEdgeDistance answer = finiteEdgeEdgeDistance(x[0], x[1], y[0], y[1]);
          return {answer.normal, answer.distance,
                  m_pair.a.radius(ofA, answer.weightA) + m_pair.b.radius(ofB, answer.weightB)};
        });
  }

  /// Lowers the free motions of two features. nearly(): about the shortest vector from q to p.
  /// isRejected(): by a filter. measured(): along the closest points.
  template <class Nearly, class IsRejected, class Measure>
  void bound(const FeatureCorners& p, const FeatureCorners& q, Nearly&& nearly,
             IsRejected&& isRejected, Measure&& measured) {
    const Limits limits(*this, RoundBox(p.points), RoundBox(q.points));
    if (limits.lowersNone(std::max(p.mostFree(), q.mostFree())) || isRejected()) return;
    const Vector3d shortest = nearly();
    const double length = shortest.norm();
    SharedGap shared = gapAlong(p.points, q.points, shortest / length);
    bool isContact = false;
    // Any direction is valid. This one will do if no other has a gap that is wider than rounding.
    if (!(m_range.freeGap(shared.gap, limits.box.size) > 0.0 &&
          length - shared.gap <=
              p.largestRadius() + q.largestRadius() + kFreeMotionError * limits.box.size.largest)) {
      const Measured at = measured();
      isContact = !(limits.free > 0.0) && m_range.isContact(at.distance - at.radii);
      shared = gapAlong(p.points, q.points, at.direction, !isContact);
    }
    // The axis may have the wider gap where radii differ along a feature.
    if (!isContact && !(shared.gap > limits.box.gap))
      shared = gapAlong(p.points, q.points, limits.box.direction);
    const double width = isContact  // it must not pass through the other feature
                             ? m_range.gapOfContact(shared.gap, limits.box.size)
                             : std::max(limits.free, m_range.freeGap(shared.gap, limits.box.size));
    const auto lowerBy = [&](double& motion, double value) {
      lower(motion, width > 0.0 ? value : 0.0);
    };
    for (int i = 0; i < p.points.count; ++i) lowerBy(p.motion(i), shared.ofP(i, width));
    for (int j = 0; j < q.points.count; ++j) lowerBy(q.motion(j), shared.ofQ(j, width));
  }

  const MeshPair& m_pair;
  const double m_searchDistance;
  const FreeMotions& m_motions;
  const FreeMotionRange m_range;
  OwnedTests m_tests;
  double m_most = 0.0;  ///< L: the free motion of the freest vertex of the batch
};

}  // namespace

void boxElements(const TriangleMesh& mesh, std::span<RoundBox> boxes) {
  PALPATE_ASSERT(boxes.size() == mesh.topology.elements.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    RoundPoints points;
    for (const std::uint32_t v : mesh.topology.elements[i]) points.add(mesh.now[v], mesh.radius(v));
    boxes[i] = RoundBox(points);
  }
}

void findFreeMotion(const MeshPair& pair, double searchDistance,
                    std::span<const ElementPair> candidates, const FreeMotions& motions) {
  PALPATE_ASSERT(motions.a.size() == pair.a.now.size() && motions.b.size() == pair.b.now.size());
  FreeMotionFinder(pair, searchDistance, motions).find(candidates);
}

}  // namespace palpate
