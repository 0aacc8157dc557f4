#include "NarrowPhase/NarrowPhase.h"

#include "NarrowPhase/Auto.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Proximity.h"

#include <algorithm>

namespace palpate {

void StepFacts::clear() {
  clearance = std::numeric_limits<double>::infinity();
  atStart = Meeting::Apart;
  for (auto* list : {&verticesA, &verticesB, &degenerateA, &degenerateB}) list->clear();
}

void StepFacts::add(const StepFacts& other) {
  clearance = std::min(clearance, other.clearance);
  atStart = std::max(atStart, other.atStart);
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

void findContacts(const MeshPair& pair, std::span<const ElementPair> candidates,
                  ContactBuffers& out) {
  const Method method = pair.settings.method;
  if (method == Method::Proximity) return findProximity(pair, candidates, out);
  if (method == Method::Intersection) return findIntersections(pair, candidates, out);
  if (method == Method::Continuous) return findContinuous(pair, candidates, out);
  findAuto(pair, candidates, out);
}

}  // namespace palpate
