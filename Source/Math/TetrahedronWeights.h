#pragma once

#include "Exact/Predicates.h"

#include <array>
#include <optional>

namespace palpate {

/// Weights of a tetrahedron's corners at a point in it or on its boundary. None if the point is
/// outside, or if the tetrahedron has no volume. Either orientation.
///
/// Exact    whether there are weights, and which are 0: the weight of corner i is 0 if the point is
///          on the opposite face. The others are positive, each within 2^-50 of its value.
std::optional<std::array<double, 4>> tetrahedronWeights(const Eigen::Vector3d& p,
                                                        const Eigen::Vector3d& a,
                                                        const Eigen::Vector3d& b,
                                                        const Eigen::Vector3d& c,
                                                        const Eigen::Vector3d& d, SignCounts&);

}  // namespace palpate
