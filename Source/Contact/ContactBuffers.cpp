#include "Contact/ContactBuffers.h"

#include "Contact/ContactLists.h"
#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

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

void StepFacts::recordTriangle(const MeshPair& pair, std::uint32_t triangle, bool isOfB,
                               const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                               const Eigen::Vector3d& c) {
  const Eigen::Vector3d u = b - a, v = c - a;
  if (!(isOfB ? pair.b : pair.a).topology.hasFaces()) return;  // a segment or a point
  if (u.cross(v).squaredNorm() > kFlatSquare * u.squaredNorm() * v.squaredNorm() ||
      hasArea(a, b, c))
    return;
  (isOfB && !pair.self() ? degenerateB : degenerateA).push_back(triangle);
}

void StepFacts::recordEdges(const MeshPair& pair, const Segment& p, const Segment& q) {
  const auto recordIfDegenerate = [](const TriangleMesh& mesh, const Segment& edge, auto& list) {
    if (mesh.topology.hasFaces() && mesh.now[edge[0]] == mesh.now[edge[1]])
      list.push_back(mesh.topology.edgeTriangles[mesh.topology.edgeOf(edge)].front());
  };
  recordIfDegenerate(pair.a, p, degenerateA);
  recordIfDegenerate(pair.b, q, pair.self() ? degenerateA : degenerateB);
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
  beyondBorder.clear();
  shapes.clear();
  featurePairs = exactDecisions = validityPairs = 0;
  facts.clear();
}

}  // namespace palpate
