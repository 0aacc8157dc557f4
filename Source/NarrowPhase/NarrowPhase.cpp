#include "NarrowPhase/NarrowPhase.h"

#include "NarrowPhase/Auto.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Proximity.h"
#include "Contact/ContactLists.h"
#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

void StepFacts::clear() {
  clearance = std::numeric_limits<double>::infinity();
  gapAtStart = std::numeric_limits<double>::infinity();
  atStart = Meeting::Apart;
  sideUnknown = false;
  for (auto* list : {&verticesA, &verticesB, &degenerateA, &degenerateB}) list->clear();
}

void StepFacts::add(const StepFacts& other) {
  clearance = std::min(clearance, other.clearance);
  gapAtStart = std::min(gapAtStart, other.gapAtStart);
  atStart = std::max(atStart, other.atStart);
  sideUnknown |= other.sideUnknown;
  for (auto list : {&StepFacts::verticesA, &StepFacts::verticesB, &StepFacts::degenerateA,
                    &StepFacts::degenerateB})
    (this->*list).insert((this->*list).end(), (other.*list).begin(), (other.*list).end());
}

void StepFacts::addShape(const ShapeContactBuffers& found, bool isAtStart) {
  double& gap = isAtStart ? gapAtStart : clearance;
  gap = std::min(gap, found.shapeGap);
  sideUnknown |= found.shapeSideUnknown;
}

void ContactBuffers::clear() {
  forEachMeshList(*this, [](ContactKind, auto& list) { list.clear(); });
  intersectingTriangles.clear();
  passages.clear();
  crossings.clear();
  crossingsAtStart.clear();
  pierced.clear();
  shapes.clear();
  featurePairs = exactDecisions = validityPairs = 0;
  facts.clear();
}

void findContacts(const MeshPair& pair, std::span<const ElementPair> candidates,
                  ContactBuffers& out) {
  PALPATE_ASSERT(!pair.has(GeometryType::Shape) && !pair.has(GeometryType::Field));
  const Method method = pair.settings.method;
  if (method == Method::Proximity) return findProximity(pair, candidates, out);
  if (method == Method::Intersection) return findIntersections(pair, candidates, out);
  if (method == Method::Continuous) return findContinuous(pair, candidates, out);
  findAuto(pair, candidates, out);
}

}  // namespace palpate
