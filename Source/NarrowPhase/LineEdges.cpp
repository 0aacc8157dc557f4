#include "NarrowPhase/LineEdges.h"

#include "NarrowPhase/Filters.h"
#include "NarrowPhase/TouchNormal.h"
#include "Math/ClosestPoint.h"

#include <utility>

namespace palpate {

namespace {

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
      const bool swapped = pair.self() && b < a;
      const std::uint32_t first = swapped ? b : a, second = swapped ? a : b;
      const std::optional<NearbyEdges> other = measureEdges(pair, first, second);
      if (!other) return true;
      out.exactDecisions += other->centres.exact;
      auto otherFeatures = other->features;
      if (swapped) std::swap(otherFeatures[0], otherFeatures[1]);
      return otherFeatures == features && std::pair(edgeA, edgeB) < std::pair(first, second);
    });
  });
}

}  // namespace

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
  const std::optional<NearbyEdges> nearby = measureEdges(pair, edgeA, edgeB, &check);
  if (!nearby) return;
  out.exactDecisions += nearby->centres.exact;
  if (pair.settings.contacts == Contacts::Distinct &&
      !isDistinct(pair, edgeA, edgeB, nearby->features, out))
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
