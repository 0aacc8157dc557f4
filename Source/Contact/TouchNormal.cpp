#include "Contact/TouchNormal.h"

#include "Math/ClosestPoint.h"
#include "Math/Foot.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace palpate {

namespace {

using Eigen::Vector3d;
using Kind = ImpactQuery::Kind;

/// Cosines that differ by less agree equally well with a side. Far above the timeTolerance by which
/// an impact may be early, so that symmetric surfaces have one answer. Any value will do.
constexpr double kEqualAgreement = 0x1p-10;
/// Of so many triangles of a star there are candidates. All of its triangles judge them.
constexpr std::size_t kMostTriangles = 16;
constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
/// How much more the winding normals of a body count than those of an open surface. Any value above
/// 1 makes the body decide.
constexpr double kBodyWeight = 4.0;

/// The triangles around a feature at a time of the step, seen from the feature.
class Star {
 public:
  Star(const TriangleMesh& mesh, const MeshFeature& feature, double time)
      : m_mesh(mesh), m_feature(feature), m_time(time) {}

  bool isAtEnd() const { return m_time == 0.0 || m_time == 1.0; }
  /// Whether the winding normals point out of a body.
  bool isOfBody() const {
    return m_mesh.topology.hasFaces() && m_mesh.topology.hasOnlyClosedStars();
  }

  /// Calls f(normal) with the unit winding normal of each triangle with area. most: of about so
  /// many triangles, evenly chosen.
  template <class F>
  void forEachNormal(F&& f, std::size_t most = kAll) const {
    anyTriangle(most, [&](const Triangle& t) {
      const std::array<Vector3d, 3> p =
          isAtEnd()
              ? std::array{end()[t[0]], end()[t[1]], end()[t[2]]}
              : std::array{Vector3d(Vector3d::Zero()), between(t[0], t[1]), between(t[0], t[2])};
      if (hasArea(p[0], p[1], p[2])) f(windingNormal(p[0], p[1], p[2]));
      return false;
    });
  }

  /// Calls f(direction) with unit vectors that span the star, until it returns true: from the
  /// feature to the triangles' other corners, and along the feature.
  template <class F>
  void anyDirection(F&& f, std::size_t most = kAll) const {
    const auto passes = [&](const Vector3d& vector) {
      return vector != Vector3d::Zero() && f(stableUnit(vector));
    };
    if (m_feature.kind == MeshFeature::Kind::Vertex) {
      anyTriangle(most, [&](const Triangle& corners) {
        return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t corner) {
          return passes(between(m_feature.id, corner));
        });
      });
      return;
    }
    if (m_feature.kind == MeshFeature::Kind::Face) {
      const Triangle& corners = m_mesh.topology.elements[m_feature.id];
      for (int i = 0; i < 3; ++i) {
        const Vector3d along = between(corners[i], corners[(i + 1) % 3]);
        if (passes(along) || passes(-along)) return;
      }
      return;
    }
    const std::uint32_t p = m_mesh.topology.edges[m_feature.id][0],
                        q = m_mesh.topology.edges[m_feature.id][1];
    const Vector3d along = stableUnit(between(p, q));
    if (passes(along) || passes(-along)) return;
    anyTriangle(most, [&](const Triangle& corners) {
      return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t corner) {
        if (corner == p || corner == q) return false;
        const Vector3d to = stableUnit(between(p, corner)), inward = to - to.dot(along) * along;
        return inward.norm() > kTouchAngle && passes(inward);
      });
    });
  }

  /// Calls f(direction) with the unit direction of each edge at a vertex, or of the edge.
  template <class F>
  void forEachEdge(F&& f, std::size_t most) const {
    if (m_feature.kind == MeshFeature::Kind::Vertex)
      return anyDirection([&](const Vector3d& d) { return f(d), false; }, most);
    if (m_feature.kind == MeshFeature::Kind::Face) return;
    const auto& [p, q] = m_mesh.topology.edges[m_feature.id];
    const Vector3d along = between(p, q);
    if (along != Vector3d::Zero()) f(stableUnit(along));
  }

 private:
  /// Calls f for the triangles, or for about `most` of them, until it returns true.
  template <class F>
  void anyTriangle(std::size_t most, F&& f) const {
    const MeshTopology& topology = m_mesh.topology;
    if (m_feature.kind == MeshFeature::Kind::Face) {
      f(topology.elements[m_feature.id]);
      return;
    }
    const auto around = holdersOf(topology, m_feature);
    const std::size_t stride = around.size() > most ? around.size() / most + 1 : 1;
    for (std::size_t i = 0; i < around.size(); i += stride)
      if (f(topology.elements[around[i]])) return;
  }
  const Positions& end() const { return m_time == 1.0 ? m_mesh.now : m_mesh.before; }
  /// The vector between two vertices, times a power of two if it is tiny: interpolated denormals
  /// would have no direction.
  Vector3d between(std::uint32_t p, std::uint32_t q) const {
    Vector3d before = m_mesh.before[q] - m_mesh.before[p], now = m_mesh.now[q] - m_mesh.now[p];
    if (isAtEnd()) return m_time == 1.0 ? now : before;
    if (std::max(before.cwiseAbs().maxCoeff(), now.cwiseAbs().maxCoeff()) < kTinyLength) {
      before /= kTinyLength;
      now /= kTinyLength;
    }
    return (1.0 - m_time) * before + m_time * now;
  }

  const TriangleMesh& m_mesh;
  const MeshFeature m_feature;
  const double m_time;
};

/// What the step tells about the side of the first feature.
struct KnownSide {
  Approach approach;
  /// The normal of the plane through both features, on that side. None if they were always in it.
  std::optional<Vector3d> plane;
  bool withBorder = false;  ///< directions across the approach are on the side, too

  bool has(const Vector3d& normal) const {
    const double least = withBorder ? -kTouchAngle : kTouchAngle;
    return normal.dot(approach.side) > least && normal.dot(approach.origin) > least &&
           (!plane || normal.dot(*plane) > -kTouchAngle);
  }
};

/// The best of the candidates so far, as touchNormal() orders them.
class BestNormal {
 public:
  BestNormal(const Star& first, const Star& second, const std::optional<KnownSide>& side,
             const Vector3d& other)
      : m_first(first),
        m_second(second),
        m_side(side),
        m_other(other),
        m_equalAngle(first.isAtEnd() ? kTouchAngle : kEqualAgreement) {}

  /// kind: lower ones win among equally good candidates.
  void offer(const Vector3d& normal, int kind) {
    if (m_normal == normal || (m_side && !m_side->has(normal))) return;
    const double violation = std::round(violationOf(normal) / m_equalAngle);
    if (m_normal && violation > m_rank[0]) return;
    const double agreement =
        normal.dot(m_side && !m_side->withBorder ? m_side->approach.side : knownSides());
    const Rank rank{violation,
                    static_cast<double>(kind),
                    -std::round(agreement / kEqualAgreement),
                    std::abs(normal[0]),
                    std::abs(normal[1]),
                    std::abs(normal[2]),
                    -std::round(normal.dot(m_other) / kEqualAgreement)};
    if (m_normal && !(rank < m_rank)) return;
    m_normal = normal;
    m_rank = rank;
  }
  void offerBoth(const Vector3d& normal, int kind) { offer(normal, kind), offer(-normal, kind); }
  bool separates() const { return m_normal && m_rank[0] == 0.0; }
  bool separates(const Vector3d& normal) const {
    return std::round(violationOf(normal) / m_equalAngle) == 0.0;
  }
  const Vector3d& other() const { return m_other; }
  Vector3d normal() const { return m_normal.value_or(m_other); }

 private:
  /// The lowest wins: how far the normal fails to separate the stars, its kind, and how far it
  /// agrees with the sides that are known. The last components leave ties only between
  /// mirror images: otherwise numbering changes no result.
  using Rank = std::array<double, 7>;

  /// The sine of the largest angle by which a direction of a star is on the wrong side; or of one
  /// by which the normal is worse than the best one.
  double violationOf(const Vector3d& normal) const {
    const double limit =
        m_normal ? (m_rank[0] + 1.0) * m_equalAngle : std::numeric_limits<double>::infinity();
    double most = 0.0;
    const auto isBeyond = [&](double sine) { return (most = std::max(most, sine)) > limit; };
    m_first.anyDirection([&](const Vector3d& d) { return isBeyond(-normal.dot(d)); });
    if (most <= limit)
      m_second.anyDirection([&](const Vector3d& d) { return isBeyond(normal.dot(d)); });
    return most;
  }
  /// The mean winding normal of the second star, less that of the first.
  const Vector3d& knownSides() {
    const auto meanOf = [](const Star& star) -> Vector3d {
      Vector3d sum = Vector3d::Zero();
      double count = 0.0;
      star.forEachNormal([&](const Vector3d& winding) { sum += winding, ++count; });
      return count > 0.0 ? sum / count * (star.isOfBody() ? kBodyWeight : 1.0) : sum;
    };
    if (!m_sides) m_sides = meanOf(m_second) - meanOf(m_first);
    return *m_sides;
  }

  const Star &m_first, &m_second;
  const std::optional<KnownSide>& m_side;
  const Vector3d m_other;
  const double m_equalAngle;  ///< violations that differ by less are equal
  std::optional<Vector3d> m_sides, m_normal;
  Rank m_rank{};
};

/// Offers every candidate that may be needed.
void offerAll(const Star& first, const Star& second, BestNormal& best) {
  for (const Star* star : {&second, &first})
    star->forEachNormal([&](const Vector3d& normal) { best.offerBoth(normal, 0); }, kMostTriangles);
  if (!best.separates())
    first.forEachEdge(
        [&](const Vector3d& u) {
          second.forEachEdge(
              [&](const Vector3d& v) {
                const Vector3d normal = u.cross(v);
                if (normal.norm() > kTouchAngle) best.offerBoth(normal.normalized(), 1);
              },
              kMostTriangles);
        },
        kMostTriangles);
  if (!best.separates()) best.offer(best.other(), 2);
}

/// Whether the features span a plane at an end of the step: the triangle has area, or the edges are
/// not parallel. Within the step rounding hides that edges are parallel.
bool spanPlane(const ImpactQuery& query, double time) {
  if (time != 0.0 && time != 1.0) return false;
  const auto at = [&](int i) -> const Vector3d& { return query.vertices[i].at(time == 1.0); };
  return query.kind == Kind::VertexTriangle
             ? hasArea(at(1), at(2), at(3))
             : unitCross(at(0), at(1), at(2), at(3)) != Vector3d::Zero();
}

bool moves(const ImpactQuery& query) {
  return std::any_of(query.vertices.begin(), query.vertices.end(),
                     [](const ImpactQuery::Step& vertex) { return vertex.before != vertex.now; });
}

}  // namespace

template <Kind kind>
TouchNormal touchNormal(const Features<kind>& of, std::uint32_t firstId, std::uint32_t secondId,
                        const std::array<MeshFeature, 2>& holders, double time,
                        const Vector3d& normal, std::size_t& exactDecisions) {
  PALPATE_ASSERT(time >= 0.0 && time <= 1.0);
  const ImpactQuery query = of.query(firstId, secondId);
  using FeatureKind = MeshFeature::Kind;
  const bool interiors = kind == Kind::VertexTriangle ? holders[1].kind == FeatureKind::Face
                                                      : holders[0].kind == FeatureKind::Edge &&
                                                            holders[1].kind == FeatureKind::Edge;
  const Star first(of.first, holders[0], time), second(of.second, holders[1], time);
  std::optional<Vector3d> plane;
  if (moves(query)) plane = normalOfPlane(query, time, exactDecisions);
  if (plane && interiors) return {*plane, true};
  std::optional<KnownSide> side;
  if (interiors && spanPlane(query, time)) {
    BestNormal best(first, second, side, normal);
    best.offerBoth(normal, 0);
    return {best.normal(), false};
  }
  if (moves(query))
    if (const auto approach = approachOf(query, time)) side = KnownSide{*approach, plane};
  BestNormal best(first, second, side, side ? side->approach.side : normal);
  offerAll(first, second, best);
  if (plane && !best.separates()) best.offer(*plane, 2);
  if (side && !best.separates()) {
    // Surfaces that slide along each other: features come from within the common plane.
    side->withBorder = true;
    BestNormal across(first, second, side, best.normal());
    offerAll(first, second, across);
    if (across.separates()) return {across.normal(), !across.separates(-across.normal())};
  }
  return {best.normal(), side.has_value()};
}

template TouchNormal touchNormal(const Features<Kind::VertexTriangle>&, std::uint32_t,
                                 std::uint32_t, const std::array<MeshFeature, 2>&, double,
                                 const Vector3d&, std::size_t&);
template TouchNormal touchNormal(const Features<Kind::EdgeEdge>&, std::uint32_t, std::uint32_t,
                                 const std::array<MeshFeature, 2>&, double, const Vector3d&,
                                 std::size_t&);

void addAtEnd(const MeshPair& pair, std::uint32_t vertex, std::uint32_t triangle, bool swapped,
              VertexTriangleDistance measured, double radii, ContactBuffers& out) {
  const Features<Kind::VertexTriangle> features{pair.meshOf(swapped), pair.meshOf(!swapped)};
  const Triangle& corners = features.second.topology.elements[triangle];
  const Positions& at = features.second.now;
  out.facts.recordTriangle(pair, triangle, !swapped, at[corners[0]], at[corners[1]],
                           at[corners[2]]);
  turnToSeparate(features, vertex, triangle, measured, out.exactDecisions);
  auto& list = out.ofVertex(pair, swapped);
  list.push_back(contactOf(vertex, triangle, corners, measured));
  list.back().distance -= radii;
}

void addAtEnd(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB,
              EdgeEdgeDistance measured, ContactBuffers& out) {
  const Segment &p = pair.a.topology.edges[edgeA], &q = pair.b.topology.edges[edgeB];
  out.facts.recordEdges(pair, p, q);
  turnToSeparate(Features<Kind::EdgeEdge>{pair.a, pair.b}, edgeA, edgeB, measured,
                 out.exactDecisions);
  out.edgeEdge.push_back(contactOf(p, q, measured));
}

}  // namespace palpate
