#include "NarrowPhase/Auto.h"

#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Proximity.h"
#include "NarrowPhase/StepCheck.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate {

namespace {

/// Bounds of the displacements of a triangle's corners, along each axis.
struct DisplacementBounds {
  Eigen::Array3d lower, upper;

  DisplacementBounds() = default;
  DisplacementBounds(const TriangleMesh& mesh, std::uint32_t triangle) {
    const auto& [a, b, c] = mesh.topology.elements[triangle];
    const auto moved = [&](std::uint32_t v) -> Eigen::Array3d {
      return mesh.now[v] - mesh.before[v];
    };
    const Eigen::Array3d ofA = moved(a), ofB = moved(b), ofC = moved(c);
    lower = ofA.min(ofB).min(ofC);
    upper = ofA.max(ofB).max(ofC);
  }
};

/// The bounds of a mesh's triangles. Those of consecutive candidates are mostly known already.
class KnownBounds {
 public:
  explicit KnownBounds(const TriangleMesh& mesh) : m_mesh(mesh) { m_triangles.fill(kNoElement); }

  const DisplacementBounds& of(std::uint32_t triangle) {
    const std::size_t place = triangle % kPlaces;
    if (m_triangles[place] != triangle) {
      m_triangles[place] = triangle;
      m_bounds[place] = DisplacementBounds(m_mesh, triangle);
    }
    return m_bounds[place];
  }

 private:
  static constexpr std::size_t kPlaces = 64;  ///< any number will do
  const TriangleMesh& m_mesh;
  std::array<std::uint32_t, kPlaces> m_triangles;
  std::array<DisplacementBounds, kPlaces> m_bounds;
};

/// Square of a bound on motionBound() of features of two triangles, without rounding.
double motionSquare(const DisplacementBounds& a, const DisplacementBounds& b) {
  return (a.upper - b.lower).abs().max((b.upper - a.lower).abs()).square().sum();
}

/// Whether motionBound() is at most `limit` plus the rounding of the pair's motions. Rounding, and
/// squares out of range, make it false for some slower triangles.
bool isCertainlyWithin(double motionSquare, double limit) {
  const double square = limit * limit;
  return limit > 0.0 && square > kSmallestSlowSquare && motionSquare < square * (1 - kSlowSlack);
}

/// Share of StepPlan::slowMotion. Where no feature moves further, most contacts of resting bodies
/// are further apart than their features moved, so that no step has to be checked. Any value will
/// do.
constexpr double kCalmShare = 0.5;

/// Divides the candidates: `calm` move at most kCalmShare of StepPlan::slowMotion, `part` further,
/// and of these `fast` may move further than slowMotion.
void divide(const MeshPair& pair, std::span<const ElementPair> candidates, ContactBuffers& out) {
  for (auto* part : {&out.calm, &out.part, &out.fast}) part->clear();
  const StepPlan& step = pair.step;
  const double rounding = step.motionWithRounding - step.motion, slow = step.slowMotion - rounding,
               calm = kCalmShare * step.slowMotion - rounding;
  KnownBounds ofA(pair.a), ofB(pair.b);
  for (const ElementPair& candidate : candidates) {
    const double square = motionSquare(ofA.of(candidate.a), ofB.of(candidate.b));
    (isCertainlyWithin(square, calm) ? out.calm : out.part).push_back(candidate);
    if (!isCertainlyWithin(square, slow)) out.fast.push_back(candidate);
  }
}

}  // namespace

void findAuto(const MeshPair& pair, std::span<const ElementPair> candidates, ContactBuffers& out) {
  PALPATE_ASSERT(pair.step.reportsImpacts && pair.step.slowMotion >= 0.0);
  divide(pair, candidates, out);
  if (pair.floats) {
    FloatPair atEnd = *pair.floats;
    atEnd.beforeA = atEnd.beforeB = nullptr;
    for (auto* slow : {&out.part, &out.calm})
      keepOverlapping(pair.a.topology, pair.b.topology, atEnd, *slow);
  }
  findProximity(pair, out.part, out);
  MeshPair calm = pair;
  calm.step.motionOfCandidates = kCalmShare * pair.step.slowMotion;
  findProximity(calm, out.calm, out);
  findFastImpacts(pair, out.fast, out);
}

}  // namespace palpate
