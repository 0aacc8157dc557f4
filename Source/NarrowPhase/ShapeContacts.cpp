#include "NarrowPhase/ShapeContacts.h"

#include <algorithm>

namespace palpate {

namespace {

using Eigen::Vector3d;

class ShapeContactFinder {
 public:
  ShapeContactFinder(const MeshPair& pair, ContactBuffers& out)
      : m_shape(pair.shape()),
        m_mesh(pair.mesh()),
        m_thickness(pair.settings.thickness),
        m_distinct(pair.settings.contacts == Contacts::Distinct),
        m_out(out) {}

  void test(std::uint32_t primitive) {
    const MeshTopology& topology = m_mesh.topology;
    const Triangle& corners = topology.triangles[primitive];
    if (!topology.isOn(primitive)) return;
    for (int i = 0; i < 3; ++i) m_ends[i] = {corners[i], m_shape.at(m_mesh.now[corners[i]])};
    for (int i = 0; i < 3; ++i) {
      const auto& [vertex, from] = m_ends[i];
      if (topology.ownsCorner(primitive, i))
        add(ShapeElement::Vertex, vertex, {vertex, vertex, vertex},
            {Vector3d::UnitX(), from.normal, from.distance, true});
      if (!topology.ownsEdge(primitive, i)) continue;
      const Segment& edge = topology.edges[topology.triangleEdges[primitive][i]];
      if (mayTouch(std::array{m_ends[i], m_ends[(i + 1) % 3]}))
        add(ShapeElement::Edge, edge[0], {edge[0], edge[1], edge[1]},
            m_shape.nearestOfEdge(m_mesh.now[edge[0]], m_mesh.now[edge[1]]));
    }
    if (topology.hasFaces() && mayTouch(m_ends))
      add(ShapeElement::Face, primitive, corners, nearestOfTriangle(corners));
  }

 private:
  struct End {
    std::uint32_t vertex;
    SignedDistance from;
  };

  /// By the slope at each end the distance, which is convex, is nowhere less than a bound; and
  /// where it falls in no direction the end itself is nearest.
  template <std::size_t size>
  bool mayTouch(const std::array<End, size>& ends) {
    ++m_out.featurePairs;
    const double reach = m_thickness + m_mesh.largestRadius;
    for (const End& end : ends) {
      double slope = 0;
      for (const End& other : ends)
        slope =
            std::min(slope, end.from.normal.dot(m_mesh.now[other.vertex] - m_mesh.now[end.vertex]));
      if (end.from.distance + slope > reach || (m_distinct && slope == 0)) return false;
    }
    return true;
  }

  NearestToShape nearestOfTriangle(const Triangle& corners) const {
    const auto at = [&](int i) -> Vector3d { return m_mesh.now[corners[i % 3]]; };
    if (const auto inside = m_shape.nearestInTriangle(at(0), at(1), at(2))) return *inside;
    NearestToShape best{};
    for (int i = 0; i < 3 && !m_distinct; ++i) {
      const NearestToShape edge = m_shape.nearestOfEdge(at(i), at(i + 1));
      if (i > 0 && !(edge.distance < best.distance)) continue;
      best = edge;
      best.weights = Vector3d::Zero();
      best.weights[i] = edge.weights[0];
      best.weights[(i + 1) % 3] = edge.weights[1];
      best.inInterior = false;
    }
    return best;
  }

  void add(ShapeElement element, std::uint32_t id, const Triangle& vertices,
           const NearestToShape& nearest) {
    const Vector3d& weights = nearest.weights;
    m_out.exactDecisions += nearest.exact;
    const double radius = m_mesh.radius(vertices, weights);
    if (!(nearest.distance - radius <= m_thickness) || (m_distinct && !nearest.inInterior)) return;
    const auto& now = m_mesh.now;
    Vector3d point = weights[0] * now[vertices[0]];
    if (element != ShapeElement::Vertex)
      point += weights[1] * now[vertices[1]] + weights[2] * now[vertices[2]];
    m_out.shape.push_back({element, id, vertices, weights, point,
                           point - nearest.distance * nearest.normal, nearest.normal,
                           nearest.distance - radius});
  }

  const Shape& m_shape;
  const TriangleMesh& m_mesh;
  const double m_thickness;
  const bool m_distinct;
  ContactBuffers& m_out;
  std::array<End, 3> m_ends;
};

}  // namespace

void findShapeContacts(const MeshPair& pair, std::span<const std::uint32_t> primitives,
                       ContactBuffers& out) {
  ShapeContactFinder finder(pair, out);
  for (const std::uint32_t primitive : primitives) finder.test(primitive);
}

void findShapePair(const MeshPair& pair, ContactBuffers& out) {
  const std::size_t before = out.shapePair.grown.exactDecisions();
  const auto [pointA, pointB, normal, distance] =
      pair.a.shape->distanceFrom(*pair.b.shape, out.shapePair);
  out.exactDecisions += out.shapePair.grown.exactDecisions() - before;
  ++out.featurePairs;
  if (distance <= pair.settings.thickness)
    out.shapeShape.push_back({pointA, pointB, normal, distance});
}

}  // namespace palpate
