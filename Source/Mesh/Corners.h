#pragma once

#include <palpate/Types.h>

#include "Math/TriangleIntersection.h"

namespace palpate {

/// The corners of a triangle. at: the positions of vertices, by index.
template <class At>
Corners cornersOf(const Triangle& triangle, const At& at) {
  return {at[triangle[0]], at[triangle[1]], at[triangle[2]]};
}

}  // namespace palpate
