#include "Shapes/ShapeContacts.h"

#include "Shapes/ShapeApproach.h"
#include "Shapes/ShapeLengths.h"
#include "Shapes/ShapeStep.h"
#include "Math/ClosestPoint.h"
#include "Math/ImpactQuery.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;

using Kind = ImpactQuery::Kind;

/// The nearest point on a triangle's edges. at(i): its corners.
template <class At>
NearestToShape nearestOnBoundary(const Shape& shape, At&& at) {
  NearestToShape best{};
  for (int i = 0; i < 3; ++i) {
    const NearestToShape edge = shape.nearestOfEdge(at(i), at((i + 1) % 3));
    if (i > 0 && !(edge.distance < best.distance)) continue;
    best = edge;
    best.weights = Vector3d::Zero();
    best.weights[i] = edge.weights[0];
    best.weights[(i + 1) % 3] = edge.weights[1];
    best.inInterior = false;
  }
  return best;
}

/// Finds when features of a mesh come near a shape within the step.
class ShapeImpacts {
 public:
  ShapeImpacts(const TriangleMesh& mesh, const PlacedShape& shape, const PairSettings& settings,
               ShapeContactBuffers& out)
      : m_mesh(mesh),
        m_before(shape.before),
        m_now(shape.now),
        m_distance(settings.thickness + m_mesh.largestRadius),
        m_isStill(m_mesh.before.hasSameBody(m_mesh.now) && !m_mesh.now.isPlaced()),
        m_out(out) {
    PALPATE_ASSERT(m_before.corners().size() == m_now.corners().size());
    m_settings.minimumDistance = m_distance + m_before.radius();
    m_settings.timeTolerance = settings.continuous.timeTolerance;
    for (std::uint32_t i = 0; i < m_before.corners().size(); ++i)
      m_motion = std::max(m_motion, motionOf(corner(i)));
    if (m_before.isPlane()) m_motion = std::numeric_limits<double>::infinity();  // a plane may turn
    if (m_before.isCylinder())  // its lateral surface turns with its ends
      m_motion += (m_now.axes().col(2) - m_before.axes().col(2)).norm() * m_before.radius();
  }

  /// L: the error of distances before the step, and how much the step may reduce them.
  std::array<double, 2> slack(ShapeElement element, const Triangle& vertices) const {
    double size = m_before.magnitude() + m_distance, square = 0;
    for (const std::uint32_t v : vertices) {
      size += m_mesh.before[v].cwiseAbs().maxCoeff();
      if (!m_isStill) square = std::max(square, (m_mesh.now[v] - m_mesh.before[v]).squaredNorm());
    }
    double motion = 0;
    if (isInRange(square))
      motion = std::sqrt(square);
    else if (!m_isStill)
      for (const std::uint32_t v : vertices) motion = std::max(motion, motionOf(vertex(v)));
    const bool still = element != ShapeElement::Vertex && m_before.isPlane();
    return {kShapeBoundError * size, still ? 0.0 : motion + m_motion};
  }

  /// The first time at which a feature's interior is near a feature of the shape. The mesh's
  /// feature must be further away before the step. If it comes near elsewhere on the shape, its
  /// vertices do so first.
  std::optional<ShapeImpact> find(ShapeElement element, const Triangle& vertices) {
    const auto& [a, b, c] = vertices;
    if (!m_before.hasCorners())
      return element == ShapeElement::Vertex ? findOfVertex(a) : findOfCylinder(element, vertices);
    m_earliest.reset();
    m_time = 1.0;
    if (element == ShapeElement::Vertex) {
      for (const auto& [i, j, k] : m_before.faces())
        testImpact({Kind::VertexTriangle, {{vertex(a), corner(i), corner(j), corner(k)}}});
    } else if (element == ShapeElement::Edge) {
      for (const auto& [i, j] : m_before.edges())
        testImpact({Kind::EdgeEdge, {{vertex(a), vertex(b), corner(i), corner(j)}}});
    } else {
      for (std::uint32_t i = 0; i < m_before.corners().size(); ++i)
        testImpact({Kind::VertexTriangle, {{corner(i), vertex(a), vertex(b), vertex(c)}}});
    }
    if (!m_earliest) return {};
    return ShapeImpact{m_time, nearest(element, *m_earliest)};
  }

 private:
  ImpactQuery::Step vertex(std::uint32_t v) const { return {m_mesh.before[v], m_mesh.now[v]}; }
  ImpactQuery::Step corner(std::uint32_t i) const {
    return {m_before.corners()[i], m_now.corners()[i]};
  }
  std::optional<ShapeImpact> findOfVertex(std::uint32_t v) {
    const auto time = timeOfVertex(v);
    if (!time) return {};
    const PointShapeDistance atTime =
        ShapeStep(m_before, m_now).signedDistanceAt({m_mesh.before[v], m_mesh.now[v]}, *time);
    recordTouchOfAxis();
    return ShapeImpact{*time, {Vector3d::UnitX(), atTime.normal, atTime.distance, true}};
  }
  std::optional<double> timeOfVertex(std::uint32_t v) {
    ++m_out.featurePairs;
    return ShapeStep(m_before, m_now)
        .firstTimeWithin({m_mesh.before[v], m_mesh.now[v]}, m_distance, m_settings.timeTolerance);
  }
  /// A cylinder without radius is a segment, which has no side where features touch it.
  void recordTouchOfAxis() {
    m_out.shapeSideUnknown |= m_before.isCylinder() && !(m_settings.minimumDistance > 0);
  }
  /// The first time at which an edge or a triangle is near the cylinder.
  std::optional<double> timeOfElement(ShapeElement element, const Triangle& vertices) {
    const std::size_t size = element == ShapeElement::Edge ? 2 : 3;
    std::array<std::array<Vector3d, 3>, 2> ends;
    for (std::size_t i = 0; i < size; ++i)
      ends[0][i] = m_mesh.before[vertices[i]], ends[1][i] = m_mesh.now[vertices[i]];
    ShapeApproach approach({{std::span(ends[0]).first(size), std::span(ends[1]).first(size)}},
                           movingBody(m_before, m_now));
    ++m_out.featurePairs;
    const auto time = approach.firstTimeWithin(m_distance, m_settings.timeTolerance);
    m_out.exactDecisions += approach.exactDecisions();
    return time;
  }

  /// An edge or a triangle is a contact when it first comes near. It is not if its nearest point is
  /// then on its boundary, and the boundary's feature is itself a contact at that time or earlier.
  std::optional<ShapeImpact> findOfCylinder(ShapeElement element, const Triangle& vertices) {
    const auto time = timeOfElement(element, vertices);
    if (!time) return {};
    recordTouchOfAxis();
    std::optional<Shape>& shapeAtTime = m_out.shapePair.shapeAtTime;
    if (!shapeAtTime) shapeAtTime = m_before;
    shapeAtTime->placeBetween(m_before, m_now, *time);
    std::array<Vector3d, 3> x;
    for (int i = 0; i < 3; ++i)
      x[i] = (1.0 - *time) * m_mesh.before[vertices[i]] + *time * m_mesh.now[vertices[i]];
    ShapeImpact impact{*time, element == ShapeElement::Edge ? shapeAtTime->nearestOfEdge(x[0], x[1])
                                                            : nearestOfTriangle(*shapeAtTime, x)};
    NearestToShape& nearest = impact.nearest;
    m_out.exactDecisions += nearest.exact;
    if (!nearest.inInterior && boundaryIsNear(vertices, nearest.weights, *time)) return {};
    moveInside(element, nearest);
    return impact;
  }

  static NearestToShape nearestOfTriangle(const Shape& shape, const std::array<Vector3d, 3>& x) {
    if (const auto inside = shape.nearestInTriangle(x[0], x[1], x[2])) return *inside;
    return nearestOnBoundary(shape, [&](int i) { return x[i]; });
  }

  /// Whether the feature that contains the point of these weights is near the shape at this time,
  /// or was before.
  bool boundaryIsNear(const Triangle& vertices, const Vector3d& weights, double time) {
    std::array<std::uint32_t, 3> boundaryVertices{};
    std::size_t count = 0;
    for (int i = 0; i < 3; ++i)
      if (weights[i] > 0 && (count == 0 || boundaryVertices[count - 1] != vertices[i]))
        boundaryVertices[count++] = vertices[i];
    if (count > 2) return false;
    const auto first = count == 1
                           ? timeOfVertex(boundaryVertices[0])
                           : timeOfElement(ShapeElement::Edge,
                                           {std::min(boundaryVertices[0], boundaryVertices[1]),
                                            std::max(boundaryVertices[0], boundaryVertices[1]),
                                            std::max(boundaryVertices[0], boundaryVertices[1])});
    return first && *first <= time;
  }

  /// Moves the point into the feature's interior, so that the weights identify the feature.
  static void moveInside(ShapeElement element, NearestToShape& nearest) {
    const int size = element == ShapeElement::Edge ? 2 : 3;
    Vector3d& weights = nearest.weights;
    if (weights.head(size).minCoeff() > 0) return;
    int most = 0;
    weights.head(size).maxCoeff(&most);
    for (int i = 0; i < size; ++i) weights[i] = std::max(weights[i], kEdgeWeight);
    weights[most] = 1.0 - weights[(most + 1) % size] - (size > 2 ? weights[(most + 2) % size] : 0);
    nearest.inInterior = true;
  }

  static double motionOf(const ImpactQuery::Step& step) { return lengthOf(step.now - step.before); }

  void testImpact(const ImpactQuery& query) {
    const ImpactResult answer = findImpact(query, m_settings, m_time);
    ++m_out.featurePairs;
    m_out.exactDecisions += answer.exact;
    if (!answer.impact || (m_earliest && !(answer.time < m_time))) return;
    m_time = answer.time;
    m_earliest = query;
  }

  /// The normal at an impact of features that were apart before the step.
  template <class Closest>
  Vector3d normalOfTouch(const ImpactQuery& query, const Closest& closest) {
    if (const auto normal = normalOfPlane(query, m_time, m_out.exactDecisions)) return *normal;
    const auto approach = approachOf(query, m_time);
    m_out.shapeSideUnknown |= !approach;
    return approach ? approach->side : closest.normal;
  }

  NearestToShape nearest(ShapeElement element, const ImpactQuery& query) {
    const std::array<Vector3d, 4> p = positionsAt(query, m_time);
    NearestToShape nearest{Vector3d::UnitX(), {}, 0, true};
    const auto take = [&](const auto& closest) {
      nearest.normal =
          m_settings.minimumDistance > 0 ? closest.normal : normalOfTouch(query, closest);
      nearest.distance = closest.distance - m_before.radius();
      m_out.exactDecisions += closest.exact;
    };
    if (query.kind == Kind::EdgeEdge) {
      const EdgeEdgeDistance closest = finiteEdgeEdgeDistance(p[0], p[1], p[2], p[3]);
      take(closest);
      nearest.weights = {1.0 - closest.weightA, closest.weightA, 0.0};
      nearest.inInterior = closest.featureA == EdgeFeature::Interior;
      return nearest;
    }
    const VertexTriangleDistance closest = finiteVertexTriangleDistance(p[0], p[1], p[2], p[3]);
    take(closest);
    if (element == ShapeElement::Vertex) return nearest;
    nearest.normal = -nearest.normal;
    nearest.weights = closest.weights;
    nearest.inInterior = closest.feature == TriangleFeature::Face;
    return nearest;
  }

  const TriangleMesh& m_mesh;
  const Shape &m_before, &m_now;
  const double m_distance;  ///< L: the thickness and the mesh's largest radius
  const bool m_isStill;     ///< no vertex of the mesh moves
  ShapeContactBuffers& m_out;
  TimeOfImpactSettings m_settings;
  double m_motion = 0;  ///< L: a bound on the motion of the shape's points
  double m_time = 1.0;
  std::optional<ImpactQuery> m_earliest;
};

class ShapeContactFinder {
 public:
  ShapeContactFinder(const TriangleMesh& mesh, const PlacedShape& shape,
                     const PairSettings& settings, ShapeContactBuffers& out)
      : m_continuous(settings.method == Method::Continuous),
        m_shape(m_continuous ? shape.before : shape.now),
        m_mesh(mesh),
        m_positions(m_continuous ? m_mesh.before : m_mesh.now),
        m_thickness(settings.thickness),
        m_distinct(m_continuous || settings.contacts == Contacts::Distinct),
        m_impacts(mesh, shape, settings, out),
        m_out(out) {}

  void test(std::uint32_t element) {
    const MeshTopology& topology = m_mesh.topology;
    const Triangle& corners = topology.elements[element];
    if (!topology.isEnabled(element)) return;
    for (int i = 0; i < 3; ++i)
      m_ends[i] = {corners[i], m_shape.signedDistance(m_positions[corners[i]])};
    for (int i = 0; i < 3; ++i) {
      const auto& [vertex, from] = m_ends[i];
      if (topology.ownsCorner(element, i))
        find(ShapeElement::Vertex, vertex, {vertex, vertex, vertex}, std::array{m_ends[i]},
             [&, &from = from] {
               return NearestToShape{Vector3d::UnitX(), from.normal, from.distance, true};
             });
      if (!topology.ownsEdge(element, i)) continue;
      const Segment& edge = topology.edges[topology.triangleEdges[element][i]];
      find(ShapeElement::Edge, edge[0], {edge[0], edge[1], edge[1]},
           std::array{m_ends[i], m_ends[(i + 1) % 3]},
           [&] { return m_shape.nearestOfEdge(m_positions[edge[0]], m_positions[edge[1]]); });
    }
    if (topology.hasFaces())
      find(ShapeElement::Face, element, corners, m_ends,
           [&] { return nearestOfTriangle(corners); });
  }

 private:
  struct End {
    std::uint32_t vertex;
    PointShapeDistance from;
  };

  /// Whether a feature may be within reach. The distance is convex, so the slope at each end bounds
  /// it from below. If the distance does not fall in any direction from an end, that end is
  /// nearest.
  template <std::size_t size>
  bool mayTouch(const std::array<End, size>& ends, double limit) {
    if (size > 1) ++m_out.featurePairs;
    for (const End& end : ends) {
      double slope = 0;
      for (const End& other : ends)
        slope = std::min(slope,
                         end.from.normal.dot(m_positions[other.vertex] - m_positions[end.vertex]));
      if (end.from.distance + slope > limit) return false;
      if (m_distinct && !m_continuous && size > 1 && slope == 0) return false;
    }
    return true;
  }

  /// Finds the contact of a feature: at its positions, or the first one within the step.
  template <std::size_t size, class Nearest>
  void find(ShapeElement element, std::uint32_t id, const Triangle& vertices,
            const std::array<End, size>& ends, Nearest&& nearest) {
    const double distance = m_thickness + m_mesh.largestRadius;
    std::array<double, 2> slack{0.0, 0.0};
    if (m_continuous) slack = m_impacts.slack(element, vertices);
    const auto& [error, motion] = slack;
    const double limit = distance + error + motion;
    if (!mayTouch(ends, limit)) return;
    NearestToShape first = nearest();
    m_out.exactDecisions += first.exact;
    if (!m_continuous || first.distance <= distance + error) {
      recordGap(vertices, first);
      return add(element, id, vertices, first, m_continuous ? 0.0 : 1.0);
    }
    if (first.distance > limit) return;
    if (const auto impact = m_impacts.find(element, vertices))
      add(element, id, vertices, impact->nearest, impact->time);
  }

  /// The least gap of all is that of a feature whose interior holds its nearest point, for some
  /// feature does. Where radii differ, the largest bounds it.
  void recordGap(const Triangle& vertices, const NearestToShape& nearest) {
    const double gap = nearest.distance - m_mesh.largestRadius;
    if (!nearest.inInterior) return;
    double size = m_shape.magnitude() + m_thickness + m_mesh.largestRadius;
    for (const std::uint32_t v : vertices) size += largest(m_positions[v]);
    m_out.shapeGap = std::min(m_out.shapeGap, gap - kShapeBoundError * size);
  }

  NearestToShape nearestOfTriangle(const Triangle& corners) const {
    const auto at = [&](int i) -> Vector3d { return m_positions[corners[i]]; };
    if (const auto inside = m_shape.nearestInTriangle(at(0), at(1), at(2))) return *inside;
    return m_distinct && !m_continuous ? NearestToShape{} : nearestOnBoundary(m_shape, at);
  }

  void add(ShapeElement element, std::uint32_t id, const Triangle& vertices,
           const NearestToShape& nearest, double time) {
    if (m_distinct && !nearest.inInterior) return;
    const Vector3d& weights = nearest.weights;
    PALPATE_ASSERT(weights.minCoeff() >= 0.0 && time >= 0.0 && time <= 1.0);
    const double radius = m_mesh.radius(vertices, weights);
    if (!m_continuous && !(nearest.distance - radius <= m_thickness)) return;
    const auto at = [&](int i) -> Vector3d {
      if (time == 0.0 || !m_continuous) return m_positions[vertices[i]];
      return (1.0 - time) * m_mesh.before[vertices[i]] + time * m_mesh.now[vertices[i]];
    };
    Vector3d point = weights[0] * at(0);
    if (element != ShapeElement::Vertex) point += weights[1] * at(1) + weights[2] * at(2);
    m_out.shape.push_back({element, id, vertices, weights, point,
                           point - nearest.distance * nearest.normal, nearest.normal,
                           nearest.distance - radius, time});
  }

  const bool m_continuous;
  const Shape& m_shape;
  const TriangleMesh& m_mesh;
  const Positions& m_positions;
  const double m_thickness;
  const bool m_distinct;
  ShapeImpacts m_impacts;
  ShapeContactBuffers& m_out;
  std::array<End, 3> m_ends;
};

}  // namespace

void findShapeContacts(const TriangleMesh& mesh, const PlacedShape& shape,
                       const PairSettings& settings, std::span<const std::uint32_t> elements,
                       ShapeContactBuffers& out) {
  PALPATE_ASSERT(settings.method == Method::Proximity || settings.method == Method::Continuous);
  ShapeContactFinder finder(mesh, shape, settings, out);
  for (const std::uint32_t element : elements) finder.test(element);
}

namespace {

/// L: the radius of a ball about each point of a sphere's centre or a capsule's axis.
double roundedBy(const Shape& shape) { return shape.isCylinder() ? 0.0 : shape.radius(); }

/// L: of the distance of two shapes.
double errorOfDistance(const Shape& a, const Shape& b) {
  return 4.0 * kShapeBoundError * (a.magnitude() + b.magnitude());
}

/// Finds when two shapes come near each other within the step. The shapes are ordered first, so
/// that the order of the pair does not matter.
void findShapeImpact(const PlacedShape& first, const PlacedShape& second,
                     const PairSettings& settings, ShapeContactBuffers& out) {
  const PlacedShape *a = &first, *b = &second;
  const bool exchanged =
      b->before.precedes(a->before) || (!a->before.precedes(b->before) && b->now.precedes(a->now));
  if (exchanged) std::swap(a, b);
  const double thickness = settings.thickness, timeTolerance = settings.continuous.timeTolerance,
               error = errorOfDistance(a->before, b->before);
  const MovingBody body = movingBody(b->before, b->now);
  std::optional<double> time;
  ShapePairDistance atTime{};
  if (a->now.isPlane()) {
    const ShapeStep step(a->before, a->now);
    time = step.firstTimeWithin(body, thickness, timeTolerance);
    if (time) atTime = step.nearestAt(body, *time);
  } else {
    ShapeApproach approach(movingBody(a->before, a->now), body);
    time = approach.firstTimeWithin(thickness, timeTolerance);
    if (time && *time > 0) atTime = approach.nearestAt(*time);
    out.exactDecisions += approach.exactDecisions();
    // Where the bodies without their radii all but touch, the direction is only rounding.
    const double centres = atTime.distance + roundedBy(a->before) + roundedBy(b->before);
    out.shapeSideUnknown |=
        time && *time > 0 &&
        !(centres > kApproachSlack * (a->before.magnitude() + b->before.magnitude()));
  }
  if (!time) return;
  if (*time == 0) {
    atTime = a->before.distanceFrom(b->before, out.shapePair);
    out.shapeGap = atTime.distance - error;
  }
  if (exchanged) atTime = atTime.exchanged();
  out.shapeShape.push_back({atTime.pointA, atTime.pointB, atTime.normal, atTime.distance, *time});
}

}  // namespace

void findShapePair(const PlacedShape& a, const PlacedShape& b, const PairSettings& settings,
                   ShapeContactBuffers& out) {
  PALPATE_ASSERT(settings.method == Method::Proximity || settings.method == Method::Continuous);
  const std::size_t before = out.shapePair.polytope.exactDecisions();
  ++out.featurePairs;
  if (settings.method == Method::Continuous) {
    findShapeImpact(a, b, settings, out);
  } else {
    const auto [pointA, pointB, normal, distance] = a.now.distanceFrom(b.now, out.shapePair);
    if (distance <= settings.thickness) {
      out.shapeShape.push_back({pointA, pointB, normal, distance, 1.0});
      out.shapeGap = distance - errorOfDistance(a.now, b.now);
    }
  }
  out.exactDecisions += out.shapePair.polytope.exactDecisions() - before;
}

}  // namespace palpate
