#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/NarrowPhase.h"
#include "Mesh/ExcludedDirections.h"
#include "Math/NormalCone.h"
#include "Math/StableLength.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <tuple>

namespace palpate {

/// Contacts::Distinct for impacts of lines and points: which impacts are excluded, and which others
/// stand for these.
///
/// A triangle at a closest edge or vertex excludes the direction to the other closest point if it
/// leads into the triangle: the triangle then comes nearer to the other feature. So does a segment
/// at a vertex. An excluded impact of a vertex is dropped if another impact of the same vertex
/// stands for it. One of a line's edge is dropped if one of the same edge or of its ends does. On a
/// ridge or a border of the mesh, it must be one of the vertex that is the closest point. Another
/// impact stands for this one if it is not excluded, and
/// (1) is earlier, or as early and nearer; one with a triangle's interior may be up to
///     timeTolerance later,
/// (2) has a tangent plane that contains the other element at the step's end, and
/// (3) holds the vertex or edge in front of that plane: at the step's end, no point of it is nearer
///     to the plane than its row, or that of another such impact with the plane, says.
/// So the row that stays keeps a vertex away from the element, and the rows that stay keep an edge
/// away from it by the law of hasRidge(). A line's edge keeps its contacts with all ridges.
///
/// Laws     (1) Of all impacts the first one stays, and of equally early ones the nearest, or one
///          with a triangle's interior that is at most timeTolerance later stands for it. (2) For a
///          dropped impact of a vertex one of the same vertex stays. (3) For a dropped impact of an
///          edge one of the same edge or of one of its ends stays.
class ExcludedImpacts {
  using Vector3d = Eigen::Vector3d;

 public:
  explicit ExcludedImpacts(const MeshPair& pair) : m_pair(pair) {}

  /// Whether the rule is for this pair: one of its meshes has lines or points.
  bool mayExclude() const {
    return !(m_pair.a.topology.hasFaces() && m_pair.b.topology.hasFaces());
  }
  /// Whether edges of the pair's second mesh are those of lines near a triangle mesh.
  bool linesAreSecond() const { return m_pair.a.topology.hasFaces(); }
  const Segment& lineEdge(const EdgeEdgeContact& c) const {
    PALPATE_ASSERT(mayExclude());
    return linesAreSecond() ? c.edgeB : c.edgeA;
  }

  /// swapped: the vertex is of MeshPair::b.
  bool isExcluded(const VertexTriangleContact& c, bool swapped) const {
    if (c.feature == TriangleFeature::Face) return false;
    const int i = static_cast<int>(c.feature);
    const Segment feature = i < 3 ? Segment{c.vertices[i], c.vertices[i]}
                                  : Segment{c.vertices[i - 3], c.vertices[(i - 2) % 3]};
    return excludesDirection(swapped ? m_pair.a : m_pair.b, feature, c.normal, c.timeOfImpact);
  }
  bool isExcluded(const EdgeEdgeContact& c) const {
    return isExcludedBy(m_pair.b, c.edgeB, c.featureB, c.normal, c.timeOfImpact) ||
           isExcludedBy(m_pair.a, c.edgeA, c.featureA, -c.normal, c.timeOfImpact);
  }

  // Whether another impact stands for an excluded one. anyOf(f): whether f(s, planeOf(s)) is true
  // for an impact s that is not excluded, of the same vertex; or for an edge pair, of the same edge
  // of a line or of one of its ends.

  template <class AnyOf>
  bool isReplaced(const VertexTriangleContact& c, bool swapped, AnyOf&& anyOf) const {
    return anyOf([&](const auto& s, const TangentPlane& plane) {
      return isInTime(s, c) && areInPlane(plane, swapped ? m_pair.a : m_pair.b, c.vertices);
    });
  }
  template <class AnyOf>
  bool isReplaced(const EdgeEdgeContact& c, AnyOf&& anyOf) const {
    return anyOf([&](const auto& s, TangentPlane plane) {
      if (!isInTime(s, c) || !areInPlane(plane, mesh(), linesAreSecond() ? c.edgeA : c.edgeB) ||
          (!isOfClosestVertex(s, c) && isOnRidge(c)))
        return false;
      anyOf([&](const auto&, const TangentPlane& other) {
        if (other.gap < plane.gap && plane.isSameAs(other)) plane.gap = other.gap;
        return false;
      });
      const Segment& edge = lineEdge(c);
      return std::all_of(edge.begin(), edge.end(), [&](std::uint32_t v) {
        return plane.hasInFront(lines().now[v], lines().radius(v));
      });
    });
  }

  /// Of the element that an impact meets. swapped: the vertex is of MeshPair::b.
  TangentPlane planeOf(const VertexTriangleContact& s, bool swapped) const {
    const TriangleMesh &vertices = swapped ? m_pair.b : m_pair.a,
                       &mesh = swapped ? m_pair.a : m_pair.b;
    Vector3d point = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) point += s.weights[i] * mesh.now[s.vertices[i]];
    return planeAt(s.normal, point, mesh.radius(s.vertices, s.weights), vertices.now[s.vertex],
                   vertices.radius(s.vertex));
  }
  /// Of the mesh near lines.
  TangentPlane planeOf(const EdgeEdgeContact& s) const {
    const auto pointOf = [](const TriangleMesh& mesh, const Segment& edge, double weight) {
      return Vector3d((1.0 - weight) * mesh.now[edge[0]] + weight * mesh.now[edge[1]]);
    };
    const Vector3d a = pointOf(m_pair.a, s.edgeA, s.weightA),
                   b = pointOf(m_pair.b, s.edgeB, s.weightB);
    const double radiusA = m_pair.a.radius(s.edgeA, s.weightA),
                 radiusB = m_pair.b.radius(s.edgeB, s.weightB);
    return linesAreSecond() ? planeAt(-s.normal, a, radiusA, b, radiusB)
                            : planeAt(s.normal, b, radiusB, a, radiusA);
  }

 private:
  // Of lines near a triangle mesh.
  const TriangleMesh& mesh() const { return linesAreSecond() ? m_pair.a : m_pair.b; }
  const TriangleMesh& lines() const { return linesAreSecond() ? m_pair.b : m_pair.a; }

  static Segment closestOf(const Segment& ends, EdgeFeature feature) {
    return {ends[feature == EdgeFeature::End], ends[feature != EdgeFeature::Start]};
  }
  static bool isExcludedBy(const TriangleMesh& mesh, const Segment& ends, EdgeFeature feature,
                           const Vector3d& direction, double time) {
    return mesh.topology.hasFaces() &&
           excludesDirection(mesh, closestOf(ends, feature), direction, time);
  }
  /// Whether an impact is one of the line's vertex that is the closest point of an edge's impact.
  bool isOfClosestVertex(const VertexTriangleContact& s, const EdgeEdgeContact& c) const {
    const Segment vertex =
        linesAreSecond() ? closestOf(c.edgeB, c.featureB) : closestOf(c.edgeA, c.featureA);
    return vertex == Segment{s.vertex, s.vertex};
  }
  static bool isOfClosestVertex(const EdgeEdgeContact&, const EdgeEdgeContact&) { return false; }
  /// Whether the closest point on the mesh near lines is on a ridge or a border.
  bool isOnRidge(const EdgeEdgeContact& c) const {
    const Segment feature =
        linesAreSecond() ? closestOf(c.edgeA, c.featureA) : closestOf(c.edgeB, c.featureB);
    const Segment& edge = lineEdge(c);
    return hasRidge(mesh(), feature, linesAreSecond() ? Vector3d(-c.normal) : c.normal,
                    stableLength(lines().now[edge[1]] - lines().now[edge[0]]),
                    m_pair.settings.thickness);
  }
  bool isInTime(const VertexTriangleContact& s, const auto& c) const {
    return s.feature == TriangleFeature::Face
               ? s.timeOfImpact <= c.timeOfImpact + m_pair.settings.continuous.timeTolerance
               : isEarlierOrNearer(s, c);
  }
  bool isInTime(const EdgeEdgeContact& s, const auto& c) const { return isEarlierOrNearer(s, c); }
  static bool isEarlierOrNearer(const auto& s, const auto& c) {
    return std::tie(s.timeOfImpact, s.distance) < std::tie(c.timeOfImpact, c.distance);
  }

  TangentPlane planeAt(const Vector3d& up, const Vector3d& point, double radius,
                       const Vector3d& other, double otherRadius) const {
    return {up, point, radius, up.dot(other - point) - radius - otherRadius,
            m_pair.settings.thickness};
  }

  template <class Vertices>
  static bool areInPlane(const TangentPlane& plane, const TriangleMesh& mesh,
                         const Vertices& vertices) {
    return std::all_of(vertices.begin(), vertices.end(),
                       [&](std::uint32_t v) { return plane.touches(mesh.now[v], mesh.radius(v)); });
  }
  const MeshPair& m_pair;
};

}  // namespace palpate
