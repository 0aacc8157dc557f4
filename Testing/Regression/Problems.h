#pragma once

#include <palpate/Capture.h>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace palpate::testing {

/// A small problem that an older octree solved wrongly, and its counts of contacts.
struct RegressionProblem {
  std::string name;  ///< of the file, without extension
  CollisionProblem problem;
  /// Counts of the first pair: vertex-triangle, triangle-vertex, edge-edge, intersecting triangles.
  std::array<std::size_t, 4> counts;
};

/// The generated problems of Data/Regression.
std::vector<RegressionProblem> regressionProblems();

}  // namespace palpate::testing
