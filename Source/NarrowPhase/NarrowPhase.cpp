#include "NarrowPhase/NarrowPhase.h"

#include "NarrowPhase/Auto.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Proximity.h"
#include "Shapes/ShapeContacts.h"

#include <algorithm>
#include <numeric>

namespace palpate {

void StepFacts::clear() {
  clearance = std::numeric_limits<double>::infinity();
  startsIntersecting = false;
  for (auto* list : {&verticesA, &verticesB, &degenerateA, &degenerateB}) list->clear();
}

void StepFacts::add(const StepFacts& other) {
  clearance = std::min(clearance, other.clearance);
  startsIntersecting |= other.startsIntersecting;
  for (auto list : {&StepFacts::verticesA, &StepFacts::verticesB, &StepFacts::degenerateA,
                    &StepFacts::degenerateB})
    (this->*list).insert((this->*list).end(), (other.*list).begin(), (other.*list).end());
}

void ContactBuffers::clear() {
  vertexTriangle.clear();
  triangleVertex.clear();
  edgeEdge.clear();
  intersectingTriangles.clear();
  shape.clear();
  shapeShape.clear();
  featurePairs = exactDecisions = validityPairs = 0;
  facts.clear();
}

void findContacts(const MeshPair& pair, std::span<const TrianglePair> candidates,
                  ContactBuffers& out) {
  const Method method = pair.settings.method;
  if (method == Method::Proximity) return findProximity(pair, candidates, out);
  if (method == Method::Intersection) return findIntersections(pair, candidates, out);
  if (method == Method::Continuous) return findContinuous(pair, candidates, out);
  findAuto(pair, candidates, out);
}

FeatureLists everyFeature(const MeshPair& pair) {
  FeatureLists every;
  const auto fill = [](std::vector<std::uint32_t>& list, std::size_t size) {
    list.resize(size);
    std::iota(list.begin(), list.end(), 0u);
  };
  const auto fillTested = [&](std::vector<std::uint32_t>& list, const MeshTopology& topology) {
    fill(list, topology.vertexCount);
    std::erase_if(list, [&](std::uint32_t v) { return topology.vertexTriangles[v].empty(); });
  };
  if (pair.settings.method == Method::Intersection || pair.hasShape()) {
    const MeshTopology& mesh = pair.hasShape() ? pair.mesh().topology : pair.a.topology;
    fill(every.trianglesOfA, mesh.triangles.size());
    std::erase_if(every.trianglesOfA, [&](std::uint32_t t) { return !mesh.isOn(t); });
    return every;
  }
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
  if (pair.isOfShapes()) return findShapePair(*pair.shapeOfA, *pair.shapeOfB, pair.settings, out);
  if (pair.hasShape())
    return findShapeContacts(pair.mesh(), pair.shape(), pair.settings, features.trianglesOfA, out);
  const Method method = pair.settings.method;
  if (method == Method::Proximity) return findProximityByBruteForce(pair, features, out);
  if (method == Method::Intersection) return findIntersectionsByBruteForce(pair, features, out);
  if (method == Method::Continuous) return findContinuousByBruteForce(pair, features, out);
  findAutoByBruteForce(pair, features, out);
}

}  // namespace palpate
