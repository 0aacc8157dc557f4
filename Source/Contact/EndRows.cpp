#include "Contact/EndRows.h"

#include "Contact/ExcludedImpacts.h"
#include "Contact/MeshFeature.h"
#include "Math/ClosestPoint.h"
#include "Math/MeetingAfter.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

namespace palpate {

namespace {

/// The contact of an impact's features at the step's end.
VertexTriangleContact atEnd(const MeshPair& meshes, ContactKind kind,
                            const VertexTriangleContact& c) {
  const auto sides = sidesOf(kind);
  const Positions &own = meshes.meshOf(sides[0]).now, &other = meshes.meshOf(sides[1]).now;
  const auto& [p, q, r] = c.vertices;
  return contactOf(c.vertex, c.triangle, c.vertices,
                   finiteVertexTriangleDistance(own[c.vertex], other[p], other[q], other[r]));
}
EdgeEdgeContact atEnd(const MeshPair& meshes, ContactKind, const EdgeEdgeContact& c) {
  const Positions &a = meshes.a.now, &b = meshes.b.now;
  return contactOf(
      c.edgeA, c.edgeB,
      finiteEdgeEdgeDistance(a[c.edgeA[0]], a[c.edgeA[1]], b[c.edgeB[0]], b[c.edgeB[1]]));
}

/// L: of features at the step's end, less the radii.
template <class Contact>
double gapAtEnd(const MeshPair& meshes, ContactKind kind, const Contact& c) {
  return atEnd(meshes, kind, c).distance - (meshes.a.largestRadius + meshes.b.largestRadius);
}

/// How far the closest points move apart along the normal until the step's end.
template <class Contact>
double separationUntilEnd(const MeshPair& meshes, ContactKind kind, const Contact& c) {
  const Stencil s = stencil(c);
  const auto sides = sidesOf(kind);
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const TriangleMesh& mesh = meshes.meshOf(sides[i]);
    moved += s.weights[i] * (mesh.now[s.vertices[i]] - mesh.before[s.vertices[i]]);
  }
  return (1.0 - c.timeOfImpact) * c.normal.dot(moved);
}

/// Whether an impact's features may meet in the rest of the step.
template <class Contact>
bool mayMeet(const MeshPair& meshes, ContactKind kind, const Contact& c) {
  const double radii = meshes.a.largestRadius + meshes.b.largestRadius;
  const auto sides = sidesOf(kind);
  const ImpactQuery query = queryOf(meshes.meshOf(sides[0]), meshes.meshOf(sides[3]), c);
  return mayMeetAfter(query, c.timeOfImpact, c.normal, c.distance + radii, radii);
}

}  // namespace

void EndRows::find(const MeshPair& meshes, const Impacts& impacts, const DroppedImpacts& dropped) {
  m_self = meshes.self();
  m_rowOf.assign(impacts.contents(), kNoRow);
  m_rows.clear();
  m_kinds.clear();
  m_nearest.clear();
  startVertices(meshes);
  findCandidates(meshes, impacts, dropped);
  if (!m_candidates.empty()) {
    findMet(meshes, impacts);
    makeRows(impacts);
  }
  m_isMarked = false;
  if (m_rows.empty()) return;
  takeNearest(meshes, impacts, dropped);
  takeNormals(meshes, impacts);
}

/// Calls f(state) for the vertices of an impact, and returns whether any call did.
template <class Contact, class F>
bool EndRows::anyVertex(const Contact& c, ContactKind kind, F&& f) {
  const auto sides = sidesOf(kind);
  const auto vertices = verticesOf(c);
  bool any = false;
  for (std::size_t i = 0; i < 4; ++i) any |= f(m_met[m_self ? 0 : sides[i]][vertices[i]]);
  return any;
}

void EndRows::startVertices(const MeshPair& meshes) {
  for (std::size_t side = 0; side < 2; ++side) {
    const std::size_t size = meshes.meshOf(side).now.size();
    if (m_isMarked)  // a deadline ended the last call
      m_met[side].assign(size, kUnknown);
    else if (m_met[side].size() < size)
      m_met[side].resize(size, kUnknown);
  }
  m_isMarked = true;
}

void EndRows::findCandidates(const MeshPair& meshes, const Impacts& impacts,
                             const DroppedImpacts& dropped) {
  m_candidates.clear();
  impacts.forEach([&](const auto& c, const ImpactPlace& place) {
    if (dropped.isDropped[place]) return;
    const double gap = gapAtEnd(meshes, place.kind, c);
    if (!meshes.settings.smoothNormals &&
        !(c.distance + separationUntilEnd(meshes, place.kind, c) < gap))
      return;
    if (mayMeet(meshes, place.kind, c)) return;
    m_candidates.push_back({place, gap});
    anyVertex(c, place.kind, [](std::uint8_t& met) { return met = kAsked; });
  });
}

/// Finds out which vertices of candidates may have met the other mesh.
void EndRows::findMet(const MeshPair& meshes, const Impacts& impacts) {
  impacts.forEach([&](const auto& c, const ImpactPlace& place) {
    const ContactKind kind = place.kind;
    if (anyVertex(c, kind, [](std::uint8_t met) { return met == kAsked; }) &&
        mayMeet(meshes, kind, c))
      anyVertex(c, kind, [](std::uint8_t& met) {
        if (met == kAsked) met = kMet;
        return false;
      });
  });
}

/// Makes the rows of candidates of which no vertex may have met the other mesh.
void EndRows::makeRows(const Impacts& impacts) {
  for (const auto& [place, gap] : m_candidates)
    impacts.with(place, [&, at = place, least = gap](const auto& c) {
      if (anyVertex(c, at.kind, [](std::uint8_t met) { return met == kMet; })) return;
      m_rowOf[at] = static_cast<std::uint32_t>(m_rows.size());
      m_rows.push_back({0, stencil(c), c.normal, least});
      m_kinds.push_back(at.kind);
      m_nearest.push_back(at);
    });
  for (const Candidate& candidate : m_candidates)
    impacts.with(candidate.place, [&](const auto& c) {
      anyVertex(c, candidate.place.kind, [](std::uint8_t& met) { return met = kUnknown; });
    });
}

void EndRows::takeNearest(const MeshPair& meshes, const Impacts& impacts,
                          const DroppedImpacts& all) {
  TimeCheck check(64);
  for (const DroppedImpacts::StandIn& each : all.standIns) {
    check();
    const ImpactPlace &dropped = each.dropped, &standIn = each.kept;
    // An impact that stands for others is dropped only for another one with its features.
    const ImpactPlace kept = all.isDropped[standIn] ? all.sameFeatures[standIn] : standIn;
    PALPATE_ASSERT(!all.isDropped[kept]);
    const std::uint32_t row = m_rowOf[kept];
    if (row == kNoRow) continue;
    impacts.with(dropped, [&](const auto& c) {
      const double gap = gapAtEnd(meshes, dropped.kind, c);
      if (!(gap < m_rows[row].gap)) return;
      m_rows[row].gap = gap;
      m_nearest[row] = dropped;
    });
  }
}

void EndRows::takeNormals(const MeshPair& meshes, const Impacts& impacts) {
  TimeCheck check(64);
  const ExcludedImpacts rule(meshes);
  for (std::size_t row = 0; row < m_rows.size(); ++row) {
    check();
    const ContactKind kind = m_nearest[row].kind;
    impacts.with(m_nearest[row], [&](const auto& impact) {
      Stencil& own = m_rows[row].stencil;
      const auto c = atEnd(meshes, kind, impact);
      const Stencil its = stencil(c);
      const bool isOfSame = kind == m_kinds[row] &&
                            (kind == ContactKind::EdgeEdge ? its.vertices == own.vertices
                                                           : its.vertices[0] == own.vertices[0]);
      if (!isOfSame || rule.isExcluded(SidedImpact(kind, c))) return;
      own = its;
      m_rows[row].normal = c.normal;
    });
  }
}

}  // namespace palpate
