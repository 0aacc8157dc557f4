#include "Shapes/ShapeNearings.h"

#include "Shapes/ShapeApproach.h"
#include "Shapes/ShapeLengths.h"
#include "Shapes/ShapeStep.h"
#include "Math/ClosestPoint.h"
#include "Math/Nearing.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// A moving body and a moving shape.
class BodyAndShape {
 public:
  BodyAndShape(const MovingBody& body, const PlacedShape& shape, double tolerance)
      : m_body(body), m_shape(shape), m_tolerance(tolerance) {
    if (!isPlane()) m_approach.emplace(body, movingBody(shape.before, shape.now));
    for (std::size_t i = 0; i < body.corners[0].size(); ++i)
      m_motion = std::max(m_motion, lengthOf(body.corners[1][i] - body.corners[0][i]));
    const double turn = (shape.now.axes() - shape.before.axes()).norm();
    double ofShape = lengthOf(shape.now.origin() - shape.before.origin());
    for (std::size_t i = 0; i < shape.before.corners().size(); ++i)
      ofShape = std::max(ofShape, lengthOf(shape.now.corners()[i] - shape.before.corners()[i]));
    m_size = body.radius + body.cylinderRadius + shape.before.radius();
    for (const int end : {0, 1})
      for (const Vector3d& corner : body.corners[end])
        m_size = std::max(m_size, largest(corner - (end == 0 ? shape.before : shape.now).origin()));
    m_motion += ofShape + turn * (isPlane() ? 3 * m_size : shape.before.radius());
    m_size += shape.before.isPlane() ? 0.0 : shape.before.magnitude();
  }

  double motion() const { return m_motion; }
  /// L: how much nearer than before the step the body may come.
  double slack(double radius) const {
    return kNearingSlack * (m_size + radius) + kNearingTolerances * m_tolerance * m_motion;
  }
  std::optional<double> firstTimeWithin(double distance) {
    return isPlane() ? ShapeStep(m_shape.before, m_shape.now)
                           .firstTimeWithin(m_body, distance, m_tolerance)
                     : m_approach->firstTimeWithin(distance, m_tolerance);
  }
  /// a: on the body. If the body is in the shape, the distance is 0, and of a plane negative.
  ShapePairDistance nearestAt(double time) {
    if (!isPlane()) return m_approach->nearestAt(time);
    return ShapeStep(m_shape.before, m_shape.now).nearestAt(m_body, time).exchanged();
  }
  /// Whether a step that begins at this distance can keep it.
  bool canKeep(double distance) const {
    const Shape &before = m_shape.before, &now = m_shape.now;
    // The body's radius counts in the distance, and what is beyond it has no radius to give way.
    const double hard = distance + m_body.radius + (isPlane() ? 0.0 : roundRadius());
    const bool isStraight = isPlane() && !before.isTwoSided() && before.axes() == now.axes();
    return hard > 0.0 || isStraight;
  }
  std::size_t exactDecisions() const { return m_approach ? m_approach->exactDecisions() : 0; }

 private:
  bool isPlane() const { return m_shape.before.isPlane(); }
  double roundRadius() const { return m_shape.before.isCylinder() ? 0.0 : m_shape.before.radius(); }

  const MovingBody& m_body;
  const PlacedShape& m_shape;
  const double m_tolerance;
  std::optional<ShapeApproach> m_approach;
  double m_motion = 0, m_size = 0;
};

/// The first time at which the body comes within the radius, or nearer than it began.
std::optional<double> timeOfNearing(BodyAndShape& pair, double radius, double distance) {
  if (distance > radius) {
    const auto time = pair.firstTimeWithin(radius);
    if (!time || *time > 0.0) return time;
  }
  const double kept = std::min(distance, radius) - pair.slack(radius);
  if (!pair.canKeep(kept)) return 0.0;
  return pair.firstTimeWithin(kept);
}

/// The elements of a mesh and a shape.
class ElementNearings {
 public:
  ElementNearings(const TriangleMesh& mesh, const PlacedShape& shape, double tolerance,
                  ShapeContactBuffers& out)
      : m_mesh(mesh), m_shape(shape), m_tolerance(tolerance), m_out(out) {}

  void test(std::uint32_t element) {
    const Triangle& corners = m_mesh.topology.elements[element];
    double radius = 0;
    for (int i = 0; i < 3; ++i) {
      m_ends[0][i] = m_mesh.before[corners[i]];
      m_ends[1][i] = m_mesh.now[corners[i]];
      m_radii[i] = m_mesh.radius(corners[i]);
      radius = std::max(radius, m_radii[i]);
    }
    const MovingBody body = bodyOf(m_ends);
    BodyAndShape pair(body, m_shape, m_tolerance);
    ++m_out.featurePairs;
    const double distance = pair.nearestAt(0.0).distance;
    std::optional<double> time = 0.0;
    if (!(distance > radius) && m_radii[0] != m_radii[1])
      time = timeOfNoClearance(pair.motion(), m_tolerance,
                               [&](double at) { return clearanceAt(at) - pair.slack(radius); });
    if (time && *time == 0.0) time = timeOfNearing(pair, radius, distance);
    if (time) add(element, corners, pair, *time);
    m_out.exactDecisions += pair.exactDecisions();
  }

 private:
  using Ends = std::array<std::array<Vector3d, 3>, 2>;

  MovingBody bodyOf(const Ends& ends) const {
    const GeometryType type = m_mesh.topology.type;
    const std::size_t size = type == GeometryType::Points ? 1 : type == GeometryType::Lines ? 2 : 3;
    return {{{std::span(ends[0]).first(size), std::span(ends[1]).first(size)}}};
  }

  /// A segment's lower bound of the distance of its surface, by pieces of one radius each.
  double clearanceAt(double time) const {
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < kTaperPieces; ++i) {
      const double from = static_cast<double>(i) / kTaperPieces,
                   to = static_cast<double>(i + 1) / kTaperPieces;
      Ends piece;
      for (int end = 0; end < 2; ++end) {
        piece[end][0] = (1.0 - from) * m_ends[end][0] + from * m_ends[end][1];
        piece[end][1] = (1.0 - to) * m_ends[end][0] + to * m_ends[end][1];
        piece[end][2] = piece[end][1];
      }
      const auto radiusAt = [&](double at) { return (1.0 - at) * m_radii[0] + at * m_radii[1]; };
      const MovingBody body = bodyOf(piece);
      least = std::min(least, BodyAndShape(body, m_shape, m_tolerance).nearestAt(time).distance -
                                  std::max(radiusAt(from), radiusAt(to)));
    }
    return least;
  }

  void add(std::uint32_t element, const Triangle& corners, BodyAndShape& pair, double time) {
    const ShapePairDistance nearest = pair.nearestAt(time);
    std::array<Vector3d, 3> x;
    for (int i = 0; i < 3; ++i) x[i] = (1.0 - time) * m_ends[0][i] + time * m_ends[1][i];
    const auto closest = finiteVertexTriangleDistance(nearest.pointA, x[0], x[1], x[2]);
    const Vector3d& weights = closest.weights;
    m_out.shape.push_back({ShapeElement::Face, element, corners, weights, nearest.pointA,
                           nearest.pointB, nearest.normal,
                           nearest.distance - m_mesh.radius(corners, weights), time});
  }

  const TriangleMesh& m_mesh;
  const PlacedShape& m_shape;
  const double m_tolerance;
  ShapeContactBuffers& m_out;
  Ends m_ends;
  std::array<double, 3> m_radii;
};

}  // namespace

void findShapeNearings(const TriangleMesh& mesh, const PlacedShape& shape, double timeTolerance,
                       std::span<const std::uint32_t> elements, ShapeContactBuffers& out) {
  ElementNearings nearings(mesh, shape, timeTolerance, out);
  for (const std::uint32_t element : elements)
    if (mesh.topology.isEnabled(element)) nearings.test(element);
}

void findShapePairNearing(const PlacedShape& first, const PlacedShape& second, double timeTolerance,
                          ShapeContactBuffers& out) {
  const PlacedShape *a = &first, *b = &second;
  const bool exchanged = a->before.isPlane() || b->before.precedes(a->before) ||
                         (!a->before.precedes(b->before) && b->now.precedes(a->now));
  if (exchanged && !b->before.isPlane()) std::swap(a, b);  // a plane is the second
  PALPATE_ASSERT(!a->before.isPlane());
  const MovingBody body = movingBody(a->before, a->now);
  BodyAndShape pair(body, *b, timeTolerance);
  ++out.featurePairs;
  const auto time = timeOfNearing(pair, 0.0, pair.nearestAt(0.0).distance);
  if (time) {
    ShapePairDistance nearest = pair.nearestAt(*time);
    if (a != &first) nearest = nearest.exchanged();
    out.shapeShape.push_back(
        {nearest.pointA, nearest.pointB, nearest.normal, nearest.distance, *time});
  }
  out.exactDecisions += pair.exactDecisions();
}

}  // namespace palpate
