#include "NarrowPhase/NarrowPhase.h"

#include <palpate/Error.h>

namespace palpate {

void ContactBuffers::clear() {
  vertexTriangle.clear();
  triangleVertex.clear();
  edgeEdge.clear();
  intersectingTriangles.clear();
  featurePairs = exactDecisions = 0;
}

void findContacts(const MeshPair&, std::span<const TrianglePair>, ContactBuffers&) {
  throw Error(ErrorCode::UnsupportedMethod, "no narrow phase exists yet");
}

void findContactsByBruteForce(const MeshPair&, ContactBuffers&) {
  throw Error(ErrorCode::UnsupportedMethod, "no narrow phase exists yet");
}

}  // namespace palpate
