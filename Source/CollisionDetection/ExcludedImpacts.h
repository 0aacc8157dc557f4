#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/NarrowPhase.h"
#include "Mesh/ExcludedDirections.h"
#include "Math/NormalCone.h"
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
/// at a vertex. An excluded impact of a vertex, or of a line's edge, is dropped if another impact
/// that is not excluded, of the same vertex, or of the same edge or one of its ends,
/// (1) is earlier, or as early and nearer; one with a triangle's interior may be up to
///     timeTolerance later,
/// (2) has a tangent plane that contains the other element at the step's end, and
/// (3) holds the vertex or edge in front of that plane: at the step's end, no point of it is nearer
///     to the plane than its row, or that of another such impact with the plane, says.
/// So the rows that stay keep the vertex or edge away from the element. Tissue that is bent, or
/// that bends around a tool within the step, keeps all its contacts.
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
      if (!isInTime(s, c) || !areInPlane(plane, mesh(), linesAreSecond() ? c.edgeA : c.edgeB))
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

  bool isExcludedBy(const TriangleMesh& mesh, const Segment& ends, EdgeFeature feature,
                    const Vector3d& direction, double time) const {
    const Segment closest{ends[feature == EdgeFeature::End], ends[feature != EdgeFeature::Start]};
    return mesh.topology.hasFaces() && excludesDirection(mesh, closest, direction, time);
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
