#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/NarrowPhase.h"
#include "Mesh/ExcludedDirections.h"
#include "Math/NormalCone.h"
#include "Math/StableLength.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <tuple>

namespace palpate {

/// The vertices of an element, or of the part of it that holds a closest point.
struct ImpactElement {
  std::array<std::uint32_t, 3> ids{};
  std::size_t size = 0;

  ImpactElement() = default;
  explicit ImpactElement(std::uint32_t vertex) : ids{vertex}, size(1) {}
  explicit ImpactElement(const Segment& edge) : ids{edge[0], edge[1]}, size(2) {}
  explicit ImpactElement(const Triangle& corners)
      : ids{corners[0], corners[1], corners[2]}, size(3) {}

  std::span<const std::uint32_t> vertices() const { return {ids.data(), size}; }
  bool isIn(const ImpactElement& other) const {
    const auto all = other.vertices();
    return std::all_of(
        ids.begin(), ids.begin() + static_cast<std::ptrdiff_t>(size),
        [&](std::uint32_t v) { return std::find(all.begin(), all.end(), v) != all.end(); });
  }
  /// As a vertex {v, v} or an edge.
  Segment feature() const {
    PALPATE_ASSERT(size == 1 || size == 2);
    return {ids[0], ids[size - 1]};
  }
};

/// An impact of a vertex and a triangle, or of two edges, as both sides of the pair see it.
struct SidedImpact {
  std::array<ImpactElement, 2> elements, closest;  ///< of MeshPair::a and MeshPair::b
  std::array<double, 3> weights;  ///< of a triangle's corners; or of the ends' second ones
  Eigen::Vector3d normal;         ///< unit, from b to a
  double time, distance;
  std::size_t vertexSide;  ///< the side of the vertex; 2: two edges
  bool isOfFace;           ///< the closest point is in a triangle's interior

  /// swapped: the vertex is of MeshPair::b.
  SidedImpact(const VertexTriangleContact& c, bool swapped)
      : weights{c.weights[0], c.weights[1], c.weights[2]},
        normal(swapped ? Eigen::Vector3d(-c.normal) : c.normal),
        time(c.timeOfImpact),
        distance(c.distance),
        vertexSide(swapped ? 1 : 0),
        isOfFace(c.feature == TriangleFeature::Face) {
    elements[vertexSide] = closest[vertexSide] = ImpactElement(c.vertex);
    elements[1 - vertexSide] = ImpactElement(c.vertices);
    closest[1 - vertexSide] = closestOf(c);
  }
  explicit SidedImpact(const EdgeEdgeContact& c)
      : elements{ImpactElement(c.edgeA), ImpactElement(c.edgeB)},
        closest{closestOf(c.edgeA, c.featureA), closestOf(c.edgeB, c.featureB)},
        weights{c.weightA, c.weightB, 0.0},
        normal(c.normal),
        time(c.timeOfImpact),
        distance(c.distance),
        vertexSide(2),
        isOfFace(false) {}

  /// From the other side to this one.
  Eigen::Vector3d upTo(std::size_t side) const {
    return side == 0 ? normal : Eigen::Vector3d(-normal);
  }

 private:
  static ImpactElement closestOf(const VertexTriangleContact& c) {
    const int i = static_cast<int>(c.feature);
    if (i < 3) return ImpactElement(c.vertices[i]);
    if (i < 6) return ImpactElement(Segment{c.vertices[i - 3], c.vertices[(i - 2) % 3]});
    return ImpactElement(c.vertices);
  }
  static ImpactElement closestOf(const Segment& ends, EdgeFeature feature) {
    if (feature == EdgeFeature::Interior) return ImpactElement(ends);
    return ImpactElement(ends[feature == EdgeFeature::End]);
  }
};

/// Contacts::Distinct for impacts: which impacts are excluded, and which others stand for these.
///
/// An element at a closest edge or vertex excludes the direction to the other closest point if it
/// leads into the element: the element then comes nearer to the other feature. Between two meshes
/// with faces, those around both closest features exclude. Else it is the triangles or segments
/// around the feature that a vertex meets, and the triangles around that of an edge. An impact with
/// a triangle's interior is not excluded.
///
/// An excluded impact is dropped if another impact stands for it. That one *holds* an element of
/// the dropped impact on one side: its own element there is the held one, or an edge or vertex of
/// it. The held element is that of either side between two meshes with faces; else it is the
/// vertex, or the edge of a line. Another impact stands for this one if it is not excluded, and
/// (1) is earlier, or as early and nearer; one with a triangle's interior may be up to
///     timeTolerance later,
/// (2) has a tangent plane that contains the element on the other side at the step's end,
/// (3) keeps the held element in front of that plane: at the step's end, no point of it is nearer
///     to the plane than its row, or that of another such impact with the plane, says, and
/// (4) is one of the vertex that is the held element's closest point, unless the closest feature
///     of the other side is on no ridge and no border of a mesh.
/// So the row that stays keeps a vertex away from the element, and the rows that stay keep an edge
/// or a triangle away from it by the law of hasRidge(). What is held keeps its contacts with all
/// ridges.
///
/// Laws     (1) Of all impacts the first one stays, and of equally early ones the nearest, or one
///          with a triangle's interior that is at most timeTolerance later stands for it. (2) For a
///          dropped impact, one of the held element, of its edges or of its vertices stays. (3) The
///          impacts of a vertex and a triangle's interior stay.
class ExcludedImpacts {
  using Vector3d = Eigen::Vector3d;

 public:
  explicit ExcludedImpacts(const MeshPair& pair)
      : m_pair(pair), m_haveFaces(pair.a.topology.hasFaces() && pair.b.topology.hasFaces()) {}

  bool isExcluded(const SidedImpact& c) const {
    if (c.isOfFace) return false;
    return isExcludedOn(0, c) || isExcludedOn(1, c);
  }

  /// Condition (1) for an impact with this time and distance.
  bool isInTime(bool isOfFace, double time, double distance, const SidedImpact& c) const {
    return isOfFace ? time <= c.time + m_pair.settings.continuous.timeTolerance
                    : std::tie(time, distance) < std::tie(c.time, c.distance);
  }

  /// Calls f(side) for each side whose element another impact may hold for this one, or whose
  /// element this impact may hold for others, until it returns true. A vertex comes first.
  template <class F>
  bool anyHeldSide(const SidedImpact& c, F&& f) const {
    const std::size_t first =
        c.vertexSide < 2 ? c.vertexSide : m_pair.a.topology.hasFaces() && !m_haveFaces;
    return f(first) || (m_haveFaces && f(1 - first));
  }

  /// The element of an excluded impact that others may hold, and what is known about it.
  class Held {
   public:
    Held(const ExcludedImpacts& rule, const SidedImpact& c, std::size_t side)
        : m_rule(rule), m_impact(c), m_side(side) {}

    const ImpactElement& element() const { return m_impact.elements[m_side]; }

    /// Condition (2).
    bool isBeside(const TangentPlane& plane) const {
      return m_rule.isIn(plane, 1 - m_side, m_impact.elements[1 - m_side]);
    }
    /// Conditions (3) and (4), for an impact that is not excluded and holds `own`, which is the
    /// held element or a part of it. plane: its planeOf(). lowestGap(plane): the least gap of such
    /// impacts that hold parts of the held element and have this plane.
    template <class LowestGap>
    bool isReplacedBy(const ImpactElement& own, TangentPlane plane, LowestGap&& lowestGap) {
      const ImpactElement& closest = m_impact.closest[m_side];
      PALPATE_ASSERT(own.isIn(element()));
      if (element().size == 1) return true;
      plane.gap = lowestGap(plane);
      if (!m_rule.isInFront(plane, m_side, element())) return false;
      return (own.size == 1 && closest.size == 1 && own.ids[0] == closest.ids[0]) || !isOnRidge();
    }

   private:
    /// Whether the closest feature of the other side is on a ridge or a border of a mesh, as seen
    /// from the held element.
    bool isOnRidge() {
      if (!m_isOnRidge) m_isOnRidge = m_rule.isOnRidge(m_impact, m_side);
      return *m_isOnRidge;
    }

    const ExcludedImpacts& m_rule;
    const SidedImpact& m_impact;
    const std::size_t m_side;
    std::optional<bool> m_isOnRidge;
  };

  /// The plane that touches the other side, and in front of which this impact holds its element.
  TangentPlane planeOf(const SidedImpact& s, std::size_t side) const {
    const std::array<Place, 2> places{placeOf(s, 0), placeOf(s, 1)};
    const Vector3d up = s.upTo(side);
    const Place &own = places[side], &other = places[1 - side];
    return {up, other.point, other.radius,
            up.dot(own.point - other.point) - other.radius - own.radius, m_pair.settings.thickness};
  }

 private:
  /// A closest point, at the step's end.
  struct Place {
    Vector3d point;
    double radius;  ///< L
  };
  const TriangleMesh& meshOf(std::size_t side) const { return side == 0 ? m_pair.a : m_pair.b; }

  Place placeOf(const SidedImpact& s, std::size_t side) const {
    const TriangleMesh& mesh = meshOf(side);
    const auto& [p, q, r] = s.elements[side].ids;
    if (s.elements[side].size == 1) return {mesh.now[p], mesh.radius(p)};
    if (s.vertexSide == 2) {
      const double weight = s.weights[side];
      return {(1.0 - weight) * mesh.now[p] + weight * mesh.now[q],
              mesh.radius(Segment{p, q}, weight)};
    }
    Place place{Vector3d::Zero(), mesh.radius(Triangle{p, q, r}, Vector3d(s.weights.data()))};
    for (std::size_t i = 0; i < 3; ++i)
      place.point += s.weights[i] * mesh.now[s.elements[side].ids[i]];
    return place;
  }

  bool isExcludedOn(std::size_t side, const SidedImpact& c) const {
    const TriangleMesh& mesh = meshOf(side);
    if (!m_haveFaces && (c.vertexSide == side || (c.vertexSide == 2 && !mesh.topology.hasFaces())))
      return false;
    return excludesDirection(mesh, c.closest[side].feature(), c.upTo(1 - side), c.time);
  }
  bool isOnRidge(const SidedImpact& c, std::size_t side) const {
    const TriangleMesh& mesh = meshOf(side);
    const auto held = c.elements[side].vertices();
    double length = 0.0;
    for (std::size_t i = 0; i < held.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        length = std::max(length, stableLength(mesh.now[held[i]] - mesh.now[held[j]]));
    return hasRidge(meshOf(1 - side), c.closest[1 - side].feature(), c.upTo(side), length,
                    m_pair.settings.thickness);
  }
  bool isIn(const TangentPlane& plane, std::size_t side, const ImpactElement& element) const {
    const TriangleMesh& mesh = meshOf(side);
    const auto vertices = element.vertices();
    return std::all_of(vertices.begin(), vertices.end(),
                       [&](std::uint32_t v) { return plane.touches(mesh.now[v], mesh.radius(v)); });
  }

  bool isInFront(const TangentPlane& plane, std::size_t side, const ImpactElement& element) const {
    const TriangleMesh& mesh = meshOf(side);
    const auto vertices = element.vertices();
    return std::all_of(vertices.begin(), vertices.end(), [&](std::uint32_t v) {
      return plane.hasInFront(mesh.now[v], mesh.radius(v));
    });
  }

  const MeshPair& m_pair;
  const bool m_haveFaces;
};

}  // namespace palpate
