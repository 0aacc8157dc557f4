#pragma once

#include <palpate/Types.h>

#include "Mesh/FloatPositions.h"
#include "Math/Box.h"

#include <cstdint>
#include <span>

namespace palpate {

/// Computes outward-rounded boxes of triangles [begin, end), and the box of each group of
/// consecutive triangles.
///
/// Shapes   vertices: the mesh's positions now. before: those at the step's start, in which case
///          boxes enclose the motion over the step; or null.
///          triangles: from `begin` on. boxes: of all triangles.
///          groups: group g is triangles [groups[g], groups[g + 1]); the first starts at `begin`,
///          the last ends at `end`. groupBoxes: one per group.
/// Cost     about 20 instructions a triangle.
void triangleBoxes(const FloatPoint* vertices, const FloatPoint* before, const Triangle* triangles,
                   std::span<const std::uint32_t> groups, BoxArrays& boxes, FloatBox* groupBoxes);

}  // namespace palpate
