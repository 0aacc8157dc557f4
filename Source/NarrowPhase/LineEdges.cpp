#include "NarrowPhase/LineEdges.h"

#include "Contact/Filters.h"
#include "NarrowPhase/TouchNormal.h"
#include "Mesh/ExcludedDirections.h"
#include "Math/ClosestPoint.h"
#include "Math/NormalCone.h"
#include "Math/StableLength.h"
#include "Core/Assert.h"

#include <algorithm>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Calls f(edge) once for each edge that holds the feature, until f returns false. Returns whether
/// all calls returned true.
template <class F>
bool allEdgesAt(const MeshTopology& topology, const MeshFeature& feature, F&& f) {
  if (feature.kind == MeshFeature::Kind::Edge) return f(feature.id);
  for (const std::uint32_t triangle : topology.vertexTriangles[feature.id])
    for (int i = 0; i < 3; ++i) {
      if (!topology.ownsEdge(triangle, i)) continue;
      const std::uint32_t edge = topology.triangleEdges[triangle][i];
      const auto [p, q] = topology.edges[edge];
      if ((p == feature.id || q == feature.id) && !f(edge)) return false;
    }
  return true;
}

/// The condition for Contacts::Distinct that testLineEdges() describes.
bool isDistinct(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB,
                const std::array<MeshFeature, 2>& features, ContactBuffers& out) {
  if (!areReportedByEdges(pair, features)) return false;
  return allEdgesAt(pair.a.topology, features[0], [&](std::uint32_t a) {
    return allEdgesAt(pair.b.topology, features[1], [&](std::uint32_t b) {
      if (a == edgeA && b == edgeB) return true;
      const bool swapped = pair.self() && pair.a.topology.precedes(b, a);
      const std::uint32_t first = swapped ? b : a, second = swapped ? a : b;
      const std::optional<NearbyEdges> other = measureEdges(pair, first, second);
      if (!other) return true;
      out.exactDecisions += other->centres.exact;
      auto otherFeatures = other->features;
      if (swapped) std::swap(otherFeatures[0], otherFeatures[1]);
      return otherFeatures == features && (edgeA == first ? pair.b.topology.precedes(edgeB, second)
                                                          : pair.a.topology.precedes(edgeA, first));
    });
  });
}

/// Whether a line's vertex has a contact with the interior of a triangle, and is at most as far
/// away as the edges. swapped: the line is MeshPair::b.
bool isOverFace(const MeshPair& pair, std::uint32_t vertex, std::uint32_t triangle, bool swapped,
                double distance) {
  const TriangleMesh &line = swapped ? pair.b : pair.a, &mesh = swapped ? pair.a : pair.b;
  const Triangle& corners = mesh.topology.elements[triangle];
  const VertexTriangleDistance measured = finiteVertexTriangleDistance(
      line.now[vertex], mesh.now[corners[0]], mesh.now[corners[1]], mesh.now[corners[2]]);
  return measured.feature == TriangleFeature::Face &&
         measured.distance - line.radius(vertex) <= distance &&
         !rejectsVertex(pair, vertex, triangle, swapped) &&
         !pointsInwardAtEnd(pair, vertex, {MeshFeature::Kind::Face, triangle}, measured, swapped);
}

/// Whether the line's edge comes nearer to another edge of a triangle. Where its closest point is
/// its end, that vertex has a contact.
bool isNearerToSide(const MeshPair& pair, std::uint32_t edge, std::uint32_t triangle, bool swapped,
                    double distance) {
  const auto& sides = (swapped ? pair.a : pair.b).topology.triangleEdges[triangle];
  return std::any_of(sides.begin(), sides.end(), [&](std::uint32_t side) {
    if (side == kNoEdge) return false;
    const auto other = swapped ? measureEdges(pair, side, edge) : measureEdges(pair, edge, side);
    return other && other->distance < distance &&
           (areReportedByEdges(pair, other->features) || !pair.hasFilters());
  });
}

}  // namespace

bool isExcludedByFaces(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB,
                       const NearbyEdges& nearby) {
  const bool swapped = pair.a.topology.hasFaces();
  const TriangleMesh &line = swapped ? pair.b : pair.a, &mesh = swapped ? pair.a : pair.b;
  const MeshTopology& topology = mesh.topology;
  if (!topology.hasFaces()) return false;
  const std::uint32_t edge = swapped ? edgeB : edgeA;
  const Segment& vertices = line.topology.edges[edge];
  const MeshFeature& feature = nearby.features[!swapped];
  const bool isVertex = feature.kind == MeshFeature::Kind::Vertex;
  const Segment ends = isVertex ? Segment{feature.id, feature.id} : topology.edges[feature.id];
  const Vector3d towardsLine = swapped ? Vector3d(-nearby.centres.normal) : nearby.centres.normal;
  const Vector3d p = mesh.now[ends[0]], q = mesh.now[ends[1]];
  const auto leadsTo = [&](std::uint32_t corner) {
    if (corner == ends[0] || corner == ends[1]) return false;
    const Vector3d r = mesh.now[corner];
    return isVertex ? leadsTowards(towardsLine, p, r) : leadsInto(towardsLine, p, q, r);
  };
  const auto around =
      isVertex ? topology.vertexTriangles[feature.id] : topology.edgeTriangles[feature.id];
  const bool isExcluded = std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
    const Triangle& corners = topology.elements[triangle];
    if (std::none_of(corners.begin(), corners.end(), leadsTo)) return false;
    return std::any_of(vertices.begin(), vertices.end(),
                       [&](std::uint32_t v) {
                         return isOverFace(pair, v, triangle, swapped, nearby.distance);
                       }) ||
           isNearerToSide(pair, edge, triangle, swapped, nearby.distance);
  });
  return isExcluded && !hasRidge(mesh, ends, towardsLine,
                                 stableLength(line.now[vertices[1]] - line.now[vertices[0]]),
                                 pair.settings.thickness);
}

std::optional<NearbyEdges> measureEdges(const MeshPair& pair, std::uint32_t edgeA,
                                        std::uint32_t edgeB, StepCheck* check) {
  const Segment &p = pair.a.topology.edges[edgeA], &q = pair.b.topology.edges[edgeB];
  if (pair.excludesEdges(edgeA, edgeB) || areNearAtRest(pair, p, q)) return {};
  const EdgeEdgeDistance centres = finiteEdgeEdgeDistance(pair.a.now[p[0]], pair.a.now[p[1]],
                                                          pair.b.now[q[0]], pair.b.now[q[1]]);
  if (check) check->recordGap(edgeA, edgeB, centres.distance - pair.largestRadii(p, q));
  const double radii = pair.a.radius(p, centres.weightA) + pair.b.radius(q, centres.weightB);
  const double distance = centres.distance - radii;
  if (!(distance <= pair.settings.thickness) || rejectsEdges(pair, edgeA, edgeB)) return {};
  return NearbyEdges{centres,
                     distance,
                     {featureOf(pair.a.topology, edgeA, centres.featureA),
                      featureOf(pair.b.topology, edgeB, centres.featureB)}};
}

void testLineEdges(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB, StepCheck& check,
                   ContactBuffers& out) {
  PALPATE_ASSERT(pair.has(GeometryType::Lines));
  const std::optional<NearbyEdges> nearby = measureEdges(pair, edgeA, edgeB, &check);
  if (!nearby) return;
  out.exactDecisions += nearby->centres.exact;
  if (pair.reportsDistinct() && (!isDistinct(pair, edgeA, edgeB, nearby->features, out) ||
                                 isExcludedByFaces(pair, edgeA, edgeB, *nearby)))
    return;
  if (pointInwardAtEnd(pair, edgeA, edgeB, nearby->centres)) return;
  EdgeEdgeDistance centres = nearby->centres;
  turnToSeparate(Features<ImpactQuery::Kind::EdgeEdge>{pair.a, pair.b}, edgeA, edgeB, centres,
                 out.exactDecisions);
  out.edgeEdge.push_back(
      contactOf(pair.a.topology.edges[edgeA], pair.b.topology.edges[edgeB], centres));
  out.edgeEdge.back().distance = nearby->distance;
}

}  // namespace palpate
