#pragma once

#include "Queries/RayTraversal.h"
#include "Bodies/Body.h"
#include "Math/Box.h"
#include "Math/RayTriangle.h"
#include "Math/Tolerances.h"

#include <algorithm>

namespace palpate {

/// How a ray's parameter t follows from that of its FloatRay: the latter is t perT - start.
struct OctreeRay {
  double start, perT;

  /// Sets the ray in the floats of the body's octree, and the filter. radius: L, by which boxes
  /// grow. Returns false if the ray certainly misses all boxes.
  bool clip(const Body&, const RaySegment&, double radius, FloatRay&, LineFilter&);
  /// At least the parameter of a t. Never negative, which would end a traversal: `start` is
  /// rounded.
  float floatOf(double t) const {
    const double along = (t * perT - start) * (1.0 + kNearestError);
    return std::max(OutwardRounding::up(along), 0.0f);
  }
};

}  // namespace palpate
