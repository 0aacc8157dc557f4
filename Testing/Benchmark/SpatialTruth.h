#pragma once

#include "SpatialEngine.h"

namespace palpate::benchmark {

/// Errors of an engine's answers against brute force in long double.
struct SpatialErrors {
  double widest = 0;  ///< L: largest error of a distance
  std::size_t wrong =
      0;               ///< wrong triangles or sides, leaks; missing and needless elements of lists
  std::size_t of = 0;  ///< answers compared
};

/// The errors of each engine's answers; none where an engine has no answers. tolerance: L. An
/// element whose true distance is within it of the limit may be in or out, and of triangles whose
/// distances differ by less either is right.
std::vector<SpatialErrors> errorsOf(SpatialQuery, std::span<const SpatialCase>, const ShapeSizes&,
                                    std::span<const SpatialAnswers> ofEngines,
                                    const std::vector<Triangle>&,
                                    const std::vector<Eigen::Vector3d>& positions,
                                    double tolerance);

}  // namespace palpate::benchmark
