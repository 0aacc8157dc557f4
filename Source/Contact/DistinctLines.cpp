#include "Contact/DistinctLines.h"

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

/// Whether edge pairs report contacts between these features, of the pair's first and second mesh.
/// Edges report no contact of a vertex with a triangle mesh.
bool areReportedByEdges(const MeshPair& pair, const std::array<MeshFeature, 2>& features) {
  constexpr auto kVertex = MeshFeature::Kind::Vertex;
  return !(pair.b.topology.hasFaces() && features[0].kind == kVertex) &&
         !(pair.a.topology.hasFaces() && features[1].kind == kVertex);
}

/// Whether the two edges are those that report the contact of these features.
bool areLowest(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB,
               const std::array<MeshFeature, 2>& features, std::size_t& exactDecisions) {
  if (!areReportedByEdges(pair, features)) return false;
  return allEdgesAt(pair.a.topology, features[0], [&](std::uint32_t a) {
    return allEdgesAt(pair.b.topology, features[1], [&](std::uint32_t b) {
      if (a == edgeA && b == edgeB) return true;
      const bool swapped = pair.self() && pair.a.topology.precedes(b, a);
      const std::uint32_t first = swapped ? b : a, second = swapped ? a : b;
      const std::optional<NearbyEdges> other = measureEdges(pair, first, second);
      if (!other) return true;
      exactDecisions += other->centres.exact;
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

/// Whether triangles exclude the contact. False for two line meshes.
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
  const auto around = holdersOf(topology, feature);
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

}  // namespace

bool areDistinct(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB,
                 const NearbyEdges& nearby, std::size_t& exactDecisions) {
  PALPATE_ASSERT(pair.has(GeometryType::Lines));
  return areLowest(pair, edgeA, edgeB, nearby.features, exactDecisions) &&
         !isExcludedByFaces(pair, edgeA, edgeB, nearby);
}

}  // namespace palpate
