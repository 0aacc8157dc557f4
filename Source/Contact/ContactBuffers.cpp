#include "Contact/ContactBuffers.h"

#include "Contact/ContactLists.h"

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

}  // namespace palpate
