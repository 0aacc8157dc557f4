#include "Search/TreeCandidates.h"

#include "NarrowPhase/ElementBoxes.h"
#include "Math/Tolerances.h"

#include <algorithm>

namespace palpate {

namespace {

/// Whether the traversal may skip neighbours that UnfoldedStars proves not to touch. It may if the
/// method reports nothing but touching features: Continuous, without a thickness.
bool reportsOnlyTouching(const Question& question) {
  return question.self() && question.plan.method == Method::Continuous &&
         question.a.mesh.topology.hasFaces() && question.meshes().maxFeatureDistance() == 0.0;
}

/// L: by how much more than the thickness Continuous may report features (TimeOfImpactSettings).
/// Their boxes in the world overlap at the thickness, but those in another frame may not.
double approachSlack(const Question& question, double thickness) {
  if (!question.plan.swept()) return 0.0;
  const double motion = question.plan.motion,
               largestDifference = question.aInStep.extent + question.bInStep.extent + motion;
  return question.settings().continuous.timeTolerance * motion +
         kApproachError * (largestDifference + 2.0 * thickness);
}

FloatPair floatsOf(const Question& question, const TreePair& trees) {
  FloatPair floats{question.a.tree.floats().now(),
                   question.b.tree.floats().now(),
                   nullptr,
                   nullptr,
                   trees.shiftLower,
                   trees.shiftUpper};
  if (question.plan.swept()) {
    floats.beforeA = question.a.tree.floats().atStart();
    floats.beforeB = question.b.tree.floats().atStart();
  }
  return floats;
}

/// Whether the boxes of the traversal may be larger than those of the pair's method.
bool traversesWiderBoxes(const Question& question) {
  return question.hasWiderBoxes() || question.plan.searchDistance > 0.0;
}

void keepInWorld(const Question& question, double distance, Buffer<ElementPair>& kept) {
  keepOverlapping(question.meshes(), question.plan.swept(), distance, kept);
}

}  // namespace

std::size_t TreeCandidates::start(const Question& asked, const FrameStart& frame,
                                  bool adjacentPairs, BoxFrame boxFrame) {
  GeometryOctree &ofA = asked.a.tree, &ofB = asked.b.tree;
  if (!asked.hasElements()) return 0;
  const Triangle* const unfolded = adjacentPairs && reportsOnlyTouching(asked)
                                       ? ofA.findUnfoldedStars(asked.a.mesh, frame.threads)
                                       : nullptr;
  m_thickness =
      asked.plan.method == Method::Intersection ? 0.0 : asked.meshes().maxFeatureDistance();
  const auto treesIn = [&](BoxFrame in, double distance) {
    if (in == BoxFrame::Body) distance += approachSlack(asked, m_thickness);
    TreePair trees = treesOf(asked.a, asked.b, distance, asked.plan.swept(), in);
    if (trees.self() && !adjacentPairs) trees.adjacency = ofA.ordered().data();
    if (unfolded) trees.adjacency = unfolded;
    return trees;
  };
  m_floats = floatsOf(asked, treesIn(BoxFrame::World, m_thickness));
  // A search at the searchDistance is for boxes in the world.
  const bool searches = adjacentPairs && asked.plan.searchDistance > 0.0,
             inWorld = searches || !asked.a.isPlaced() || !asked.b.isPlaced();
  const TreePair trees =
      treesIn(inWorld ? BoxFrame::World : boxFrame,
              searches ? std::max(m_thickness, asked.plan.searchDistance) : m_thickness);
  return m_traversal.start(trees, ofA.octree().size() + ofB.octree().size(), frame);
}

/// Keeps the candidates of a batch of the traversal.
std::span<const ElementPair> TreeCandidates::candidatesAmong(const Question& question,
                                                             std::span<const ElementPair> pairs,
                                                             JobScratch& scratch) const {
  const bool widens = traversesWiderBoxes(question);
  if (!widens && !question.anyDisabled() && !isMapped()) {
    scratch.nearby = true;
    return pairs;
  }
  const PairPlan& plan = question.plan;
  const bool searches = plan.searchDistance > 0.0;
  Buffer<ElementPair>& kept = scratch.kept;
  kept.assign(pairs.begin(), pairs.end());
  // First, pairs whose boxes overlap at the thickness of the traversal. That of mapped trees finds
  // other pairs as well. So does a search if other pairs of the geometries need boxes over the
  // step.
  if (isMapped() || (searches && question.hasWiderBoxes()))
    keepInWorld(question,
                searches ? std::max(plan.step.motionWithRounding, m_thickness) : m_thickness, kept);
  scratch.nearby |= !kept.empty();
  const MeshTopology &a = question.a.mesh.topology, &b = question.b.mesh.topology;
  if (question.anyDisabled())
    std::erase_if(kept,
                  [&](const ElementPair& p) { return !a.isEnabled(p.a) || !b.isEnabled(p.b); });
  // Then those whose boxes overlap at the pair's own thickness. The boxes are those of the pair's
  // method: at the step's end, or over the whole step.
  if (isMapped()) {
    if (plan.searchDistance > m_thickness) keepInWorld(question, m_thickness, kept);
  } else if (widens) {
    keepOverlapping(a, b, m_floats, kept);
  }
  return kept;
}

}  // namespace palpate
