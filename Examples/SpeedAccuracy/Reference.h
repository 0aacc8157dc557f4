#pragma once

#include "Claims.h"
#include "Scenes.h"

#include <Eigen/Core>

#include <map>
#include <optional>
#include <vector>

namespace palpate::accuracy {

/// One step of a pair of a scene's meshes. Every vertex moves on a straight line.
struct Step {
  const scenes::SceneMesh& a;  ///< only its triangles are read
  const scenes::SceneMesh& b;
  const std::vector<Eigen::Vector3d>&aBefore, &aNow, &bBefore, &bNow;
};

/// Two features that touch within a step: the time of the first touch, and their common plane then.
struct Impact {
  double time;             ///< within 2^-50 of the step
  Eigen::Vector3d normal;  ///< towards where the vertex (edge a) came from; from b towards a
  /// L: gap along the normal between the two points that touch; negative once they have crossed.
  double gapBefore, gapNow;
  double gapAt(double t) const { return (1 - t) * gapBefore + t * gapNow; }
};

/// The correct answer for a step, with which methods are compared.
struct Reference {
  std::vector<ElementPair> touching;  ///< at any time of the step; sorted
  std::vector<ElementPair> touchingAtStart;
  /// Pairs of features that touch within the step. The impact is empty where no side is defined:
  /// the features touch from the start, are parallel, or graze.
  std::map<FeaturePair, std::optional<Impact>> impacts;
  double milliseconds = 0;  ///< time of brute force for the impacts
  /// Triangle pairs that intersect at a fine substep and are not in `touching`. A reference without
  /// errors has none.
  std::size_t contradictions = 0;
};

/// Computes the reference by brute force over all features, with exact decisions. The triangles
/// that intersect at `substeps` times of the step check it.
Reference referenceOf(const Step&, int substeps);

}  // namespace palpate::accuracy
