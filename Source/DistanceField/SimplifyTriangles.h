#pragma once

#include <palpate/Types.h>

#include <span>
#include <vector>

namespace palpate {

/// Collapses edges of triangles, by quadric error metrics. Corners of the result are corners of the
/// triangles. Edges of one triangle only stay as they are.
///
/// error    L: where the metric of a collapse exceeds this, the edge stays. The metric estimates
/// the
///          distance of the surfaces and does not bound it.
std::vector<Triangle> simplifyTriangles(std::span<const Eigen::Vector3d> positions,
                                        std::span<const Triangle> triangles, double error);

}  // namespace palpate
