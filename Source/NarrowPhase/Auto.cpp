#include "NarrowPhase/Auto.h"

#include "Math/Tolerances.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Proximity.h"
#include "NarrowPhase/StepCheck.h"

namespace palpate {

namespace {

/// Bounds of the displacements of a triangle's corners, along each axis.
struct DisplacementBounds {
  Eigen::Array3d lower, upper;

  DisplacementBounds(const TriangleMesh& mesh, std::uint32_t triangle) {
    const auto& [a, b, c] = mesh.topology.triangles[triangle];
    const auto moved = [&](std::uint32_t v) -> Eigen::Array3d {
      return mesh.now[v] - mesh.before[v];
    };
    const Eigen::Array3d ofA = moved(a), ofB = moved(b), ofC = moved(c);
    lower = ofA.min(ofB).min(ofC);
    upper = ofA.max(ofB).max(ofC);
  }
};

/// Whether motionBound() of features of two triangles may exceed `slow` plus the rounding of the
/// pair's motions. Rounding, and squares out of range, make it true for some slower triangles.
bool mayBeFast(const DisplacementBounds& a, const DisplacementBounds& b, double slow) {
  const Eigen::Array3d most = (a.upper - b.lower).abs().max((b.upper - a.lower).abs());
  const double square = slow * slow;
  return !(slow > 0.0 && square > kSmallestSlowSquare &&
           most.square().sum() < square * (1 - kSlowSlack));
}

}  // namespace

void findAuto(const MeshPair& pair, std::span<const ElementPair> candidates, ContactBuffers& out) {
  out.part.assign(candidates.begin(), candidates.end());
  if (pair.floats) {
    FloatPair atEnd = *pair.floats;
    atEnd.beforeA = atEnd.beforeB = nullptr;
    keepOverlapping(pair.a.topology, pair.b.topology, atEnd, out.part);
  }
  findProximity(pair, out.part, out);
  out.part.clear();
  const StepPlan& step = pair.step;
  const double slow = step.slowMotion - (step.motionWithRounding - step.motion);
  for (const ElementPair& candidate : candidates)
    if (mayBeFast({pair.a, candidate.a}, {pair.b, candidate.b}, slow))
      out.part.push_back(candidate);
  findFastImpacts(pair, out.part, out);
}

}  // namespace palpate
