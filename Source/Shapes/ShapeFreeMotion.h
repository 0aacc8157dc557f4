#pragma once

#include "Shapes/Shape.h"
#include "Math/FreeMotion.h"
#include "Mesh/TriangleMesh.h"

#include <cstdint>
#include <span>

namespace palpate {

/// Lowers the free motions of the vertices of these elements, and that of the shape: L, of any of
/// its points.
///
/// Threads  safe for the same free motions.
/// Source   Docs/Algorithms/FreeMotion.md
void findFreeMotion(const TriangleMesh&, const Shape&, const FreeMotionRange&,
                    std::span<const std::uint32_t> elements, std::span<double> ofVertices,
                    double& ofShape);
/// The same of two shapes.
void findFreeMotion(const Shape& a, const Shape& b, const FreeMotionRange&, ShapePairScratch&,
                    double& ofA, double& ofB);

}  // namespace palpate
