#pragma once

#include "Mesh/TriangleMesh.h"

#include <span>

namespace palpate {

/// Of each vertex those with a higher index that are nearer than `distance` (L, positive) along
/// the edges, ascending; of triangles that are switched off, too.
///
/// Cost     a search around each vertex: about as many steps as there are vertices within the
///          distance, times the logarithm of that.
/// Errors   TooLarge, where more than 2^28 pairs of vertices are that near.
IndexLists verticesWithin(const MeshTopology&, std::span<const Eigen::Vector3d> rest,
                          double distance);

}  // namespace palpate
