#include "NarrowPhase/NarrowPhase.h"

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
  if (pair.settings.method != Method::Proximity)
    throw Error(ErrorCode::UnsupportedMethod, "this method does not exist yet");
  findProximity(pair, candidates, out);
}

void findContactsByBruteForce(const MeshPair& pair, ContactBuffers& out) {
  if (pair.settings.method != Method::Proximity)
    throw Error(ErrorCode::UnsupportedMethod, "this method does not exist yet");
  findProximityByBruteForce(pair, out);
}

}  // namespace palpate
