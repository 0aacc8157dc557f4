#include "Diagnostics/ContactsByBruteForce.h"

#include "Search/ShapeWork.h"
#include "DistanceField/FieldContacts.h"
#include "NarrowPhase/Continuous.h"
#include "Contact/Filters.h"
#include "NarrowPhase/Intersection.h"
#include "Contact/Piercing.h"
#include "NarrowPhase/Proximity.h"
#include "NarrowPhase/StepCheck.h"
#include "Contact/TouchNormal.h"
#include "Mesh/ExcludedDirections.h"
#include "Math/ClosestPoint.h"
#include "Math/NormalCone.h"
#include "Core/Assert.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <optional>
#include <vector>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Tests one vertex against every triangle of a mesh, directly by the definition of
/// Contacts::Distinct.
class VertexAgainstMesh {
 public:
  explicit VertexAgainstMesh(const TriangleMesh& triangles) : m_mesh(triangles) {}

  void measure(const MeshPair& pair, const Vector3d& p, std::uint32_t vertex, ContactBuffers& out) {
    m_position = p;
    const CountedVector<Triangle>& triangles = m_mesh.topology.elements;
    m_answers.assign(triangles.size(), {});
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
      if (!m_mesh.topology.isEnabled(t) || pair.excludesVertex(vertex, t)) continue;
      const auto& [a, b, c] = triangles[t];
      m_answers[t] = finiteVertexTriangleDistance(p, m_mesh.now[a], m_mesh.now[b], m_mesh.now[c]);
      ++out.featurePairs;
      out.exactDecisions += m_answers[t]->exact;
    }
  }

  std::size_t size() const { return m_answers.size(); }

  /// Null for disabled triangles, and for those that self-collision excludes.
  const VertexTriangleDistance* answer(std::uint32_t triangle) const {
    return m_answers[triangle] ? &*m_answers[triangle] : nullptr;
  }

  MeshFeature feature(std::uint32_t triangle) const {
    return featureOf(m_mesh.topology, triangle, m_answers[triangle]->feature);
  }

  /// Whether a triangle is the lowest with its closest point on the same feature, and no triangle
  /// that holds this feature is nearer. Rejected triangles do not count.
  template <class IsRejected>
  bool isDistinct(std::uint32_t triangle, IsRejected&& isRejected) const {
    const MeshFeature own = feature(triangle);
    for (std::uint32_t other = 0; other < m_answers.size(); ++other) {
      if (!m_answers[other] || other == triangle) continue;
      if ((feature(other) == own ? other < triangle : holds(other, own) && isNearer(other, own)) &&
          !isRejected(other))
        return false;
    }
    return true;
  }

 private:
  bool holds(std::uint32_t triangle, const MeshFeature& feature) const {
    const MeshTopology& topology = m_mesh.topology;
    switch (feature.kind) {
      case MeshFeature::Kind::Vertex:
        return containsVertex(topology.elements[triangle], feature.id);
      case MeshFeature::Kind::Edge:
        return containsVertex(topology.elements[triangle], topology.edges[feature.id][0]) &&
               containsVertex(topology.elements[triangle], topology.edges[feature.id][1]);
      case MeshFeature::Kind::Face:
        return triangle == feature.id;
    }
    return false;
  }

  /// Whether a triangle that holds the feature is nearer than the feature, if the triangle's
  /// closest point is on another of its features. With area it is nearer, because its closest point
  /// is unique. Without area, several features may hold that point.
  bool isNearer(std::uint32_t triangle, const MeshFeature& feature) const {
    const Triangle& corners = m_mesh.topology.elements[triangle];
    const Vector3d a = m_mesh.now[corners[0]], b = m_mesh.now[corners[1]],
                   c = m_mesh.now[corners[2]];
    if (hasArea(a, b, c)) return true;
    if (feature.kind != MeshFeature::Kind::Vertex) return false;
    const Vector3d at = m_mesh.now[feature.id];
    return comesNearer(m_position, at, a) || comesNearer(m_position, at, b) ||
           comesNearer(m_position, at, c);
  }

  const TriangleMesh& m_mesh;
  Vector3d m_position;
  std::vector<std::optional<VertexTriangleDistance>> m_answers;
};

/// kSwapped: the vertices are of MeshPair::b.
template <bool kSwapped>
void findVertexTriangle(const MeshPair& pair, std::span<const std::uint32_t> sample,
                        ContactBuffers& out) {
  const TriangleMesh &vertices = kSwapped ? pair.b : pair.a,
                     &triangles = kSwapped ? pair.a : pair.b;
  const bool distinct = pair.reportsDistinct();
  const Features<ImpactQuery::Kind::VertexTriangle> features{vertices, triangles};
  StepCheck check(pair, out);
  VertexAgainstMesh against(triangles);
  for (const std::uint32_t v : sample) {
    against.measure(pair, vertices.now[v], v, out);
    const auto gap = [&](std::uint32_t t) {
      const VertexTriangleDistance& measured = *against.answer(t);
      return measured.distance -
             pair.radii(v, triangles.topology.elements[t], measured.weights, kSwapped);
    };
    for (std::uint32_t t = 0; t < against.size(); ++t) {
      const VertexTriangleDistance* answer = against.answer(t);
      if (!answer) continue;
      const double least =
          answer->distance - pair.largestRadii(v, triangles.topology.elements[t], kSwapped);
      if (!(least <= pair.thicknessAtEnd())) continue;
      check.recordDistance(least);
      if (check.addImpactIfTouched(features, v, t, kSwapped, least)) continue;
      if (!(gap(t) <= pair.thicknessAtEnd())) continue;
      const auto isRejected = [&](std::uint32_t triangle) {
        return rejectsVertex(pair, v, triangle, kSwapped) ||
               (!triangles.radii.empty() && !(gap(triangle) <= pair.thicknessAtEnd()));
      };
      if (isRejected(t)) continue;
      const MeshFeature feature = against.feature(t);
      if (distinct) {
        const bool isVertex = feature.kind == MeshFeature::Kind::Vertex;
        const bool reportedByOther =
            pair.self() ? feature.id < v : kSwapped && pair.b.topology.hasFaces();
        if (isVertex && reportedByOther) continue;
        if (!against.isDistinct(t, isRejected)) continue;
      }
      if (pointsInwardAtEnd(pair, v, feature, *answer, kSwapped)) {
        if (pair.step.reportsImpacts) addImpact(pair, features, v, t, kSwapped, out);
        continue;
      }
      const double radii = pair.radii(v, triangles.topology.elements[t], answer->weights, kSwapped);
      addAtEnd(pair, v, t, kSwapped, *answer, radii, out);
    }
  }
}

/// Self-collision: whether the edges are in the order in which they are tested.
bool areInOrder(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB) {
  return !pair.self() || pair.a.topology.precedes(edgeA, edgeB);
}

void findEdgeEdge(const MeshPair& pair, std::span<const std::uint32_t> sample,
                  ContactBuffers& out) {
  const CountedVector<Segment>&a = pair.a.topology.edges, &b = pair.b.topology.edges;
  const Features<ImpactQuery::Kind::EdgeEdge> features{pair.a, pair.b};
  StepCheck check(pair, out);
  for (const std::uint32_t i : sample) {
    for (std::uint32_t j = 0; j < b.size(); ++j) {
      if (!areInOrder(pair, i, j) || pair.excludesEdges(i, j) ||
          pair.b.topology.edgeTriangles[j].empty())
        continue;
      const EdgeEdgeDistance answer = finiteEdgeEdgeDistance(
          pair.a.now[a[i][0]], pair.a.now[a[i][1]], pair.b.now[b[j][0]], pair.b.now[b[j][1]]);
      ++out.featurePairs;
      out.exactDecisions += answer.exact;
      if (!(answer.distance <= pair.thicknessAtEnd())) continue;
      check.recordDistance(answer.distance);
      if (check.addImpactIfTouched(features, i, j, false, answer.distance)) continue;
      const bool inside = !answer.parallel && answer.featureA == EdgeFeature::Interior &&
                          answer.featureB == EdgeFeature::Interior;
      if (pair.reportsDistinct() && !inside) continue;
      if (rejectsEdges(pair, i, j)) continue;
      if (pointInwardAtEnd(pair, i, j, answer)) {
        if (pair.step.reportsImpacts) addImpact(pair, features, i, j, false, out);
        continue;
      }
      addAtEnd(pair, i, j, answer, out);
    }
  }
}

/// All edges that hold a feature.
std::vector<std::uint32_t> edgesOf(const MeshTopology& topology, const MeshFeature& feature) {
  if (feature.kind == MeshFeature::Kind::Edge) return {feature.id};
  std::vector<std::uint32_t> holders;
  for (std::uint32_t e = 0; e < topology.edges.size(); ++e)
    if ((topology.edges[e][0] == feature.id || topology.edges[e][1] == feature.id) &&
        !topology.edgeTriangles[e].empty())
      holders.push_back(e);
  return holders;
}

/// Vertices of lines are tested against whole triangles, and not against their edges.
bool areOfEdges(const MeshPair& pair, const std::array<MeshFeature, 2>& features) {
  constexpr auto kVertex = MeshFeature::Kind::Vertex;
  return (!pair.b.topology.hasFaces() || features[0].kind != kVertex) &&
         (!pair.a.topology.hasFaces() || features[1].kind != kVertex);
}

/// Contacts::Distinct for edges of lines: whether no other pair of edges has the contact. Measures
/// every pair of edges that hold the two features, and determines the lowest at the end.
bool areLowestOfLines(const MeshPair& pair, const std::array<std::uint32_t, 2>& edges,
                      const std::array<MeshFeature, 2>& features) {
  if (!areOfEdges(pair, features)) return false;
  std::array<std::uint32_t, 2> lowest = edges;
  for (const std::uint32_t a : edgesOf(pair.a.topology, features[0]))
    for (const std::uint32_t b : edgesOf(pair.b.topology, features[1])) {
      std::array<std::uint32_t, 2> ids{a, b};
      std::array<MeshFeature, 2> shared = features;
      if (pair.self() && !areInOrder(pair, a, b)) {
        std::swap(ids[0], ids[1]);
        std::swap(shared[0], shared[1]);
      }
      const std::optional<NearbyEdges> other = measureEdges(pair, ids[0], ids[1]);
      if (!other) continue;
      if (other->features != shared) return false;
      if (ids[0] == lowest[0] ? pair.b.topology.precedes(ids[1], lowest[1])
                              : pair.a.topology.precedes(ids[0], lowest[0]))
        lowest = ids;
    }
  return lowest == edges;
}

/// Contacts::Distinct for an edge of a line and one of a triangle mesh: whether a triangle into
/// which the direction to the line leads has a contact of the line's edge that is at least as near.
/// Tests all triangles.
bool excludesLine(const MeshPair& pair, const std::array<std::uint32_t, 2>& edges,
                  const NearbyEdges& nearby) {
  const bool swapped = pair.a.topology.hasFaces();
  const TriangleMesh &line = pair.meshOf(swapped), &mesh = pair.meshOf(!swapped);
  if (!mesh.topology.hasFaces()) return false;
  const Segment& ofLine = line.topology.edges[edges[swapped]];
  const MeshFeature& closest = nearby.features[!swapped];
  const Segment ends = closest.kind == MeshFeature::Kind::Vertex ? Segment{closest.id, closest.id}
                                                                 : mesh.topology.edges[closest.id];
  const Vector3d up = swapped ? Vector3d(-nearby.centres.normal) : nearby.centres.normal;
  const auto leadsTo = [&](std::uint32_t corner) {
    if (corner == ends[0] || corner == ends[1]) return false;
    const Vector3d p = mesh.now[ends[0]], q = mesh.now[ends[1]], r = mesh.now[corner];
    return ends[0] == ends[1] ? leadsTowards(up, p, r) : leadsInto(up, p, q, r);
  };
  const auto hasOver = [&](std::uint32_t vertex, std::uint32_t triangle) {
    const auto& [a, b, c] = mesh.topology.elements[triangle];
    const VertexTriangleDistance over =
        finiteVertexTriangleDistance(line.now[vertex], mesh.now[a], mesh.now[b], mesh.now[c]);
    return over.feature == TriangleFeature::Face &&
           over.distance - line.radius(vertex) <= nearby.distance &&
           !rejectsVertex(pair, vertex, triangle, swapped) &&
           !pointsInwardAtEnd(pair, vertex, {MeshFeature::Kind::Face, triangle}, over, swapped);
  };
  const auto hasNearer = [&](std::uint32_t side) {
    if (side == kNoEdge) return false;
    const auto other =
        swapped ? measureEdges(pair, side, edges[1]) : measureEdges(pair, edges[0], side);
    return other && other->distance < nearby.distance &&
           (areOfEdges(pair, other->features) || !pair.hasFilters());
  };
  const double length = (line.now[ofLine[1]] - line.now[ofLine[0]]).norm();
  for (std::uint32_t t = 0; t < mesh.topology.elements.size(); ++t) {
    const Triangle& corners = mesh.topology.elements[t];
    const auto& sides = mesh.topology.triangleEdges[t];
    if (mesh.topology.isEnabled(t) && containsVertex(corners, ends[0]) &&
        containsVertex(corners, ends[1]) && std::any_of(corners.begin(), corners.end(), leadsTo) &&
        (hasOver(ofLine[0], t) || hasOver(ofLine[1], t) ||
         std::any_of(sides.begin(), sides.end(), hasNearer)))
      return !hasRidge(mesh, ends, up, length, pair.settings.thickness);
  }
  return false;
}

void findLineEdges(const MeshPair& pair, std::span<const std::uint32_t> sample,
                   ContactBuffers& out) {
  const CountedVector<Segment>&a = pair.a.topology.edges, &b = pair.b.topology.edges;
  StepCheck check(pair, out);
  for (const std::uint32_t i : sample)
    for (std::uint32_t j = 0; j < b.size(); ++j) {
      if (!areInOrder(pair, i, j) || pair.b.topology.edgeTriangles[j].empty()) continue;
      ++out.featurePairs;
      double gap = std::numeric_limits<double>::infinity();
      const std::optional<NearbyEdges> nearby = measureEdges(pair, i, j, &gap);
      check.recordGap(i, j, gap);
      if (!nearby ||
          (pair.reportsDistinct() && (!areLowestOfLines(pair, {i, j}, nearby->features) ||
                                      excludesLine(pair, {i, j}, *nearby))) ||
          pointInwardAtEnd(pair, i, j, nearby->centres))
        continue;
      out.exactDecisions += nearby->centres.exact;
      EdgeEdgeDistance centres = nearby->centres;
      turnToSeparate(Features<ImpactQuery::Kind::EdgeEdge>{pair.a, pair.b}, i, j, centres,
                     out.exactDecisions);
      out.edgeEdge.push_back(contactOf(a[i], b[j], centres));
      out.edgeEdge.back().distance = nearby->distance;
    }
}

void findProximity(const MeshPair& pair, const FeatureLists& features, ContactBuffers& out) {
  findVertexTriangle<false>(pair, features.verticesOfA, out);
  findVertexTriangle<true>(pair, features.verticesOfB, out);
  if (pair.has(GeometryType::Lines))
    findLineEdges(pair, features.edgesOfA, out);
  else
    findEdgeEdge(pair, features.edgesOfA, out);
}

/// Calls f(features, firstId, secondId, swapped) for the listed features with every feature of the
/// other mesh. swapped: features.first is MeshPair::b.
template <class F>
void forEachFeaturePair(const MeshPair& pair, const FeatureLists& lists, ContactBuffers& out,
                        F&& f) {
  for (const bool swapped : {false, true}) {
    const Features<ImpactQuery::Kind::VertexTriangle> features{swapped ? pair.b : pair.a,
                                                               swapped ? pair.a : pair.b};
    const CountedVector<Triangle>& triangles = features.second.topology.elements;
    for (const std::uint32_t v : swapped ? lists.verticesOfB : lists.verticesOfA) {
      for (std::uint32_t t = 0; t < triangles.size(); ++t) {
        if (!features.second.topology.isEnabled(t) || pair.excludesVertex(v, t)) continue;
        ++out.featurePairs;
        f(features, v, t, swapped);
      }
    }
  }
  const auto edgeCount = static_cast<std::uint32_t>(pair.b.topology.edges.size());
  for (const std::uint32_t i : lists.edgesOfA)
    for (std::uint32_t j = 0; j < edgeCount; ++j) {
      if (!areInOrder(pair, i, j) || pair.excludesEdges(i, j) ||
          pair.b.topology.edgeTriangles[j].empty())
        continue;
      ++out.featurePairs;
      f(Features<ImpactQuery::Kind::EdgeEdge>{pair.a, pair.b}, i, j, false);
    }
}

void findImpacts(const MeshPair& pair, const FeatureLists& lists, ContactBuffers& out) {
  forEachFeaturePair(
      pair, lists, out,
      [&](const auto& features, std::uint32_t firstId, std::uint32_t secondId, bool swapped) {
        addImpact(pair, features, firstId, secondId, swapped, out);
      });
}

/// Appends the impacts of feature pairs for which proximity at the step's end does not suffice.
void findFastImpacts(const MeshPair& pair, const FeatureLists& lists, ContactBuffers& out) {
  const StepCheck check(pair, out);
  forEachFeaturePair(
      pair, lists, out,
      [&](const auto& features, std::uint32_t firstId, std::uint32_t secondId, bool swapped) {
        if (!check.proximitySuffices(features, firstId, secondId))
          addImpact(pair, features, firstId, secondId, swapped, out);
      });
}

template <class Contact>
void append(const Buffer<Contact>& found, Buffer<Contact>& out) {
  out.insert(out.end(), found.begin(), found.end());
}

/// Contacts of triangles that pierce each other depend on all triangles: for a sample they are left
/// to the caller, with the crossings in `out`.
void findIntersections(const MeshPair& pair, const FeatureLists& lists, ContactBuffers& out) {
  const auto countB = static_cast<std::uint32_t>(pair.b.topology.elements.size());
  for (const std::uint32_t a : lists.trianglesOfA)
    for (std::uint32_t b = pair.self() ? a + 1 : 0; b < countB; ++b)
      if (pair.b.topology.isEnabled(b)) addIntersection(pair, {a, b}, out);
  const MeshTopology& ofA = pair.a.topology;
  if (lists.trianglesOfA.size() + ofA.disabled.size() < ofA.count()) return;
  ContactBuffers pierced;
  ContactBuffers* const found[] = {&out};
  PiercingContacts().find(pair, found, pierced);
  out.crossings.clear();
  out.pierced.clear();
  append(pierced.vertexTriangle, out.vertexTriangle);
  append(pierced.triangleVertex, out.triangleVertex);
  append(pierced.edgeEdge, out.edgeEdge);
  append(pierced.beyondBorder, out.beyondBorder);
  out.facts.add(pierced.facts);
  out.exactDecisions += pierced.exactDecisions;
}

void fill(std::vector<std::uint32_t>& list, std::size_t size) {
  list.resize(size);
  std::iota(list.begin(), list.end(), 0u);
}

FeatureLists everyElement(const MeshTopology& mesh) {
  FeatureLists every;
  fill(every.trianglesOfA, mesh.elements.size());
  std::erase_if(every.trianglesOfA, [&](std::uint32_t t) { return !mesh.isEnabled(t); });
  return every;
}

}  // namespace

FeatureLists everyFeature(const Question& question) {
  return question.hasShape() || question.usesField() ? everyElement(question.mesh().mesh.topology)
                                                     : everyFeature(question.meshes());
}

FeatureLists everyFeature(const MeshPair& pair) {
  FeatureLists every;
  const auto fillTested = [&](std::vector<std::uint32_t>& list, const MeshTopology& topology) {
    fill(list, topology.vertexCount);
    std::erase_if(list, [&](std::uint32_t v) { return topology.vertexTriangles[v].empty(); });
  };
  if (pair.settings.method == Method::Intersection) return everyElement(pair.a.topology);
  const MeshTopology &a = pair.a.topology, &b = pair.b.topology;
  if (areTested(a, b, true)) fillTested(every.verticesOfA, a);
  if (areTested(b, a, false) && !pair.self()) fillTested(every.verticesOfB, b);
  fill(every.edgesOfA, pair.a.topology.edges.size());
  std::erase_if(every.edgesOfA,
                [&](std::uint32_t e) { return pair.a.topology.edgeTriangles[e].empty(); });
  return every;
}

void findContactsByBruteForce(const MeshPair& pair, const FeatureLists& features,
                              ContactBuffers& out) {
  const Method method = pair.settings.method;
  if (method == Method::Intersection) return findIntersections(pair, features, out);
  if (method == Method::Continuous) return findImpacts(pair, features, out);
  findProximity(pair, features, out);
  if (method == Method::Auto) findFastImpacts(pair, features, out);
}

void findContactsByBruteForce(const Question& question, const FeatureLists& features,
                              ContactBuffers& out) {
  PALPATE_ASSERT(question.plan.kind != PairKind::Proxy);
  const MeshPair meshes = question.meshes();
  if (question.hasShape()) return findWithShape(question, features.trianglesOfA, out.shapes);
  if (question.usesField())
    return FieldContacts::findByBruteForce(question.mesh().mesh, question.placedField(),
                                           meshes.settings.contacts, meshes.thicknessAtEnd(),
                                           features.trianglesOfA, out.shapes);
  findContactsByBruteForce(meshes, features, out);
}

}  // namespace palpate
