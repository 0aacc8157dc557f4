#pragma once

#include "Claims.h"
#include "Scenes.h"

#include <Eigen/Core>

#include <map>
#include <optional>
#include <vector>

namespace palpate::accuracy {

/// One step of a pair of a scene's meshes, in which every vertex moves on a straight line.
struct Step {
  const scenes::SceneMesh& a;  ///< whose triangles count, not positions
  const scenes::SceneMesh& b;
  const std::vector<Eigen::Vector3d>&aBefore, &aNow, &bBefore, &bNow;
};

/// Two features that touch within a step: when first, and the plane in which they then lie.
struct Impact {
  double time;             ///< within 2^-50 of the step
  Eigen::Vector3d normal;  ///< towards where the vertex (edge a) came from; from b towards a
  /// L: along the normal, of the two points that touch, at any time of the step; negative beyond.
  double gapBefore, gapNow;
  double gapAt(double t) const { return (1 - t) * gapBefore + t * gapNow; }
};

/// What really happens in a step.
struct Truth {
  std::vector<ElementPair> touching;  ///< at any time of the step; sorted
  std::vector<ElementPair> touchingAtStart;
  /// Pairs of features that touch within the step; none where they touch from its start, are
  /// parallel, or graze, so that there is no side to speak of.
  std::map<FeaturePair, std::optional<Impact>> impacts;
  double milliseconds = 0;  ///< that brute force took for the impacts
  /// Triangle pairs seen to intersect at one of the fine substeps and not in `touching`: of a wrong
  /// truth.
  std::size_t contradictions = 0;
};

/// By brute force over all features, decided exactly; checked against the triangles that intersect
/// at `substeps` times.
Truth truthOf(const Step&, int substeps);

}  // namespace palpate::accuracy
