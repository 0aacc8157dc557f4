#pragma once

#include "Contact/Contents.h"
#include "Contact/MeshPair.h"
#include "Core/Threads.h"

#include <Eigen/Core>

#include <cstdint>
#include <span>

namespace palpate {

/// The normals of a mesh's vertices at a time of the step, each the sum of those of its enabled
/// triangles by their angles, interpolated with weights. Unit; zero if they cancel, or if the mesh
/// has no faces.
Eigen::Vector3d interpolatedNormal(const TriangleMesh&, std::span<const std::uint32_t> vertices,
                                   const double* weights, double time);

/// Writes CollisionData::smoothVertexTriangle() and so on. smoothsShape: shape() holds contacts of
/// a mesh with a shape.
void findSmoothNormals(const MeshPair&, bool smoothsShape, const Threads&,
                       CollisionData::Contents&);

}  // namespace palpate
