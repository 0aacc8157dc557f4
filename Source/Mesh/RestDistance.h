#pragma once

#include "Mesh/TriangleMesh.h"
#include "Core/Threads.h"

#include <span>

namespace palpate {

/// For each vertex, the vertices with a higher index that are nearer than `distance` (L, positive)
/// along the edges, ascending. Edges of disabled triangles count, too.
///
/// Cost     one search for each vertex, on all threads. A search takes about as many steps as there
///          are edges within the distance.
/// Errors   TooLarge, if more than 2^28 pairs of vertices are that near.
IndexLists verticesWithin(const MeshTopology&, std::span<const Eigen::Vector3d> rest,
                          double distance, const Threads&);

/// The same after a cut. before, old: the lists of the topology that was cut.
/// Cost     searches from the vertices within the distance of edges that are gone or new, and what
///          is linear in the mesh: lengths of edges, and copies of the other lists.
IndexLists verticesWithin(const MeshTopology&, std::span<const Eigen::Vector3d> rest,
                          double distance, const IndexLists& before, const MeshTopology& old,
                          const Threads&);

}  // namespace palpate
