#pragma once

#include <palpate/Types.h>

#include "Mesh/FloatPositions.h"
#include "Mesh/TriangleMesh.h"

#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// The float positions of two meshes at the step's end.
struct FloatMeshes {
  const MeshTopology& a;
  const MeshTopology& b;  ///< the same object for self-collision
  const FloatPoint* floatsA;
  const FloatPoint* floatsB;
  std::array<float, 3> offset;  ///< brings a's floats into the frame of b's
  float error;                  ///< of the difference of two coordinates
};

/// For each pair of elements, a lower bound on the distance, in units of the floats, of those of
/// their features whose test it owns (NarrowPhase/FeatureTests.h). Infinity if it owns none.
void featureBounds(const FloatMeshes&, std::span<const ElementPair>, float* bounds);

}  // namespace palpate
