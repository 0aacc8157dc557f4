#pragma once

#include <palpate/CollisionProblem.h>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace palpate::testing {

/// A small problem that an older octree answered wrongly, and its answer.
struct RegressionProblem {
  std::string name;  ///< of the file, without extension
  CollisionProblem problem;
  /// Of the first pair: vertex-triangle, triangle-vertex, edge-edge, intersecting triangles.
  std::array<std::size_t, 4> counts;
};

/// Those of Data/Regression that are made here.
std::vector<RegressionProblem> regressionProblems();

}  // namespace palpate::testing
