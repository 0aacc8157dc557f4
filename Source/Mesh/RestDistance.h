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

/// Lists that a cut changes, by their vertices, ascending.
struct ChangedLists {
  CountedVector<std::uint32_t> vertices{};
  IndexLists lists{};
  bool areAll = false;  ///< the lists are of all vertices, which are not named
};

/// How a cut changes the lists of a mesh, which has them as `before`. rest: with new vertices.
/// Cost     searches from the ends of these edges, and from the vertices within the distance of
///          them. What is linear is small: the path lengths of vertices, and disabled elements.
///          Where such vertices are many, about that of verticesWithin().
/// Errors   as verticesWithin().
ChangedLists verticesWithinAfterCut(const MeshTopology&, const EdgeChange&,
                                    std::span<const Eigen::Vector3d> rest, double distance,
                                    const IndexLists& before, const Threads&);
/// Changes lists, which have room for it.
void replaceLists(IndexLists&, ChangedLists&) noexcept;

}  // namespace palpate
