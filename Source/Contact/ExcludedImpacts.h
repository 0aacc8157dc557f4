#pragma once

#include "Contact/DistinctRule.h"
#include "Contact/ImpactPlaces.h"
#include "Contact/MeshPair.h"
#include "Contact/SidedImpact.h"
#include "Mesh/ExcludedDirections.h"
#include "Math/NormalCone.h"
#include "Math/StableLength.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace palpate {

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
    return standsInTime(isOfFace, time, distance, c.time, c.distance, m_pair.settings);
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
      return areIn(plane, m_rule.m_pair.meshOf(1 - m_side),
                   m_impact.elements[1 - m_side].vertices());
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
  Place placeOf(const SidedImpact& s, std::size_t side) const {
    const TriangleMesh& mesh = m_pair.meshOf(side);
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
    const TriangleMesh& mesh = m_pair.meshOf(side);
    if (!m_haveFaces && (c.vertexSide == side || (c.vertexSide == 2 && !mesh.topology.hasFaces())))
      return false;
    return excludesDirection(mesh, c.closest[side].feature(), c.upTo(1 - side), c.time);
  }
  bool isOnRidge(const SidedImpact& c, std::size_t side) const {
    const TriangleMesh& mesh = m_pair.meshOf(side);
    const auto held = c.elements[side].vertices();
    double length = 0.0;
    for (std::size_t i = 0; i < held.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        length = std::max(length, stableLength(mesh.now[held[i]] - mesh.now[held[j]]));
    return hasRidge(m_pair.meshOf(1 - side), c.closest[1 - side].feature(), c.upTo(side), length,
                    m_pair.settings.thickness);
  }
  bool isInFront(const TangentPlane& plane, std::size_t side, const ImpactElement& element) const {
    const TriangleMesh& mesh = m_pair.meshOf(side);
    const auto vertices = element.vertices();
    return std::all_of(vertices.begin(), vertices.end(), [&](std::uint32_t v) {
      return plane.hasInFront(mesh.now[v], mesh.radius(v));
    });
  }

  const MeshPair& m_pair;
  const bool m_haveFaces;
};

/// Finds the excluded impacts of an answer for which others stand. The scratch remembers its peak.
class ExcludedSearch {
 public:
  /// Drops them.
  void find(const MeshPair&, const Impacts&, DroppedImpacts&);

 private:
  /// An impact that is not excluded, and the side of the element that it holds.
  struct Holder {
    ImpactPlace place;
    std::uint32_t side;
    bool isOfFace;
    double time, distance;
    ImpactElement element;
    std::uint32_t plane;  ///< of m_planes; kNoPlane: not needed yet
  };
  static constexpr std::uint32_t kNoPlane = 0xffffffffu;

  std::size_t bucketOf(std::size_t side, std::uint32_t vertex) const;
  void listHolders(const ExcludedImpacts&, const Impacts&, const PerImpact<std::uint8_t>& excluded);
  TangentPlane planeOf(const ExcludedImpacts&, const Impacts&, Holder&);
  template <class IsAsked, class F>
  bool anyHolder(const SidedImpact&, std::size_t side, IsAsked&&, F&&);
  void dropIfHeld(const ExcludedImpacts&, const Impacts&, const SidedImpact&, const ImpactPlace&,
                  DroppedImpacts&);

  bool m_self = false;
  std::size_t m_buckets = 0;
  Buffer<Holder> m_holders;        ///< by the bucket of the element's first vertex
  Buffer<std::uint32_t> m_starts;  ///< of each bucket and size, in m_holders
  Buffer<TangentPlane> m_planes;   ///< of some m_holders
};

}  // namespace palpate
