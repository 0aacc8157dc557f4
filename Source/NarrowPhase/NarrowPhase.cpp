#include "NarrowPhase/NarrowPhase.h"

#include "NarrowPhase/Auto.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Proximity.h"

#include <palpate/Error.h>

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
  featurePairs = exactDecisions = 0;
  facts.clear();
}

void findContacts(const MeshPair& pair, std::span<const TrianglePair> candidates,
                  ContactBuffers& out) {
  switch (pair.settings.method) {
    case Method::Proximity:
      return findProximity(pair, candidates, out);
    case Method::Intersection:
      return findIntersections(pair, candidates, out);
    case Method::Continuous:
      return findContinuous(pair, candidates, out);
    case Method::Auto:
      return findAuto(pair, candidates, out);
    default:
      throw Error(ErrorCode::UnsupportedMethod, "this method does not exist yet");
  }
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
  if (pair.settings.method == Method::Intersection) {
    fill(every.trianglesOfA, pair.a.topology.triangles.size());
    return every;
  }
  if (pair.b.topology.hasFaces()) fillTested(every.verticesOfA, pair.a.topology);
  if (pair.a.topology.hasFaces() && !pair.self()) fillTested(every.verticesOfB, pair.b.topology);
  fill(every.edgesOfA, pair.a.topology.edges.size());
  return every;
}

void findContactsByBruteForce(const MeshPair& pair, const FeatureLists& features,
                              ContactBuffers& out) {
  switch (pair.settings.method) {
    case Method::Proximity:
      return findProximityByBruteForce(pair, features, out);
    case Method::Intersection:
      return findIntersectionsByBruteForce(pair, features, out);
    case Method::Continuous:
      return findContinuousByBruteForce(pair, features, out);
    case Method::Auto:
      return findAutoByBruteForce(pair, features, out);
    default:
      throw Error(ErrorCode::UnsupportedMethod, "this method does not exist yet");
  }
}

}  // namespace palpate
