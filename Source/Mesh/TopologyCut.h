#pragma once

#include "Mesh/TriangleMesh.h"

#include <cstdint>
#include <span>

namespace palpate {

/// The topology after a cut, equal to one that is constructed anew: these triangles are removed, in
/// ascending order, and others added. vertexCount: with new vertices.
/// Cost     copies of the arrays, and searches for what is around the cut. It is linear only where
///          elements are disabled.
MeshTopology cutTopology(const MeshTopology&, std::span<const std::uint32_t> removed,
                         std::span<const Triangle> added, std::size_t vertexCount);

}  // namespace palpate
