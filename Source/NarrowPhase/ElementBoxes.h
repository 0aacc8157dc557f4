#pragma once

#include "NarrowPhase/NarrowPhase.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"

#include <Eigen/Geometry>

#include <cstdint>

namespace palpate {

/// The box of an element's vertices at the step's end, in world coordinates (L). swept: it encloses
/// the vertices at both ends of the step.
Eigen::AlignedBox3d elementBox(const TriangleMesh&, std::uint32_t element, bool swept);

/// Whether the gap between two boxes is at most the thickness along every axis.
bool overlap(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b, double thickness);

/// The same within rounding: true for all elements whose distance may be computed as at most the
/// thickness, unless they are more than 2^22 times as large. Without a thickness it is exact.
bool mayBeWithin(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b, double thickness);

/// Keeps the pairs whose elements may be within this thickness by their boxes.
void keepOverlapping(const MeshPair&, bool swept, double thickness, Buffer<ElementPair>& pairs);

}  // namespace palpate
