#include "NarrowPhase/NarrowPhase.h"

#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Proximity.h"

#include <palpate/Error.h>

namespace palpate {

void ContactBuffers::clear() {
  vertexTriangle.clear();
  triangleVertex.clear();
  edgeEdge.clear();
  intersectingTriangles.clear();
  featurePairs = exactDecisions = 0;
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
    default:
      throw Error(ErrorCode::UnsupportedMethod, "this method does not exist yet");
  }
}

void findContactsByBruteForce(const MeshPair& pair, ContactBuffers& out) {
  switch (pair.settings.method) {
    case Method::Proximity:
      return findProximityByBruteForce(pair, out);
    case Method::Intersection:
      return findIntersectionsByBruteForce(pair, out);
    case Method::Continuous:
      return findContinuousByBruteForce(pair, out);
    default:
      throw Error(ErrorCode::UnsupportedMethod, "this method does not exist yet");
  }
}

}  // namespace palpate
