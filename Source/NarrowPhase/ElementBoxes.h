#pragma once

#include "Core/Buffer.h"
#include "Mesh/TriangleMesh.h"
#include "NarrowPhase/NarrowPhase.h"

#include <Eigen/Geometry>

#include <cstdint>

namespace palpate {

/// The box of an element's vertices at the step's end, in world coordinates (L). swept: it encloses
/// the vertices at both ends of the step.
Eigen::AlignedBox3d elementBox(const TriangleMesh&, std::uint32_t element, bool swept);

/// Whether the gap between two boxes is at most the thickness along every axis.
bool overlap(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b, double thickness);

/// Keeps the pairs whose elements' boxes overlap at this thickness.
void keepOverlapping(const MeshPair&, bool swept, double thickness, Buffer<ElementPair>& pairs);

}  // namespace palpate
