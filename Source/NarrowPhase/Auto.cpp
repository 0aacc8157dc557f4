#include "NarrowPhase/Auto.h"

#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Proximity.h"
#include "NarrowPhase/StepCheck.h"
#include "Geometry/Motion.h"

namespace palpate {

namespace {

MotionRange motionOf(const TriangleMesh& mesh, std::uint32_t triangle) {
  MotionRange range;
  for (const std::uint32_t corner : mesh.topology.triangles[triangle]) {
    const Eigen::Vector3d moved = mesh.now[corner] - mesh.before[corner];
    range.add({moved, moved, moved, 0.0, 1.0});
  }
  return range;
}

}  // namespace

void findAuto(const MeshPair& pair, std::span<const TrianglePair> candidates, ContactBuffers& out) {
  out.part.assign(candidates.begin(), candidates.end());
  if (pair.floats) {
    FloatPair atEnd = *pair.floats;
    atEnd.beforeA = atEnd.beforeB = nullptr;
    keepOverlapping(pair.a.topology, pair.b.topology, atEnd, out.part);
  }
  findProximity(pair, out.part, out);
  out.part.clear();
  for (const TrianglePair& candidate : candidates)
    if (largestMotion(motionOf(pair.a, candidate.a), motionOf(pair.b, candidate.b)) >
        pair.step.slow)
      out.part.push_back(candidate);
  findFastImpacts(pair, out.part, out);
}

void findAutoByBruteForce(const MeshPair& pair, const FeatureLists& features, ContactBuffers& out) {
  findProximityByBruteForce(pair, features, out);
  findFastImpactsByBruteForce(pair, features, out);
}

}  // namespace palpate
