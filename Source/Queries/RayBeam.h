#pragma once

#include "Octree/Octree.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

namespace palpate {

/// Up to 16 rays that go the same way, close together.
///
/// `axes[2]` is the axis along which all rays advance, and `sign` whether they ascend or descend on
/// it. A ray's place is w = sign * (coordinate on that axis), in the octree's floats. On the other
/// two axes, the coordinates of all rays are between two straight lines over w.
struct RayBeam {
  static constexpr std::size_t kSize = 16;

  std::size_t axes[3];
  float sign;
  std::uint32_t used;  ///< bit i: whether there is a ray i; other lanes hold any numbers
  float begin, end;    ///< w: the rays' range within the octree, no shorter
  /// Of the lines, at w = begin, and per w. They are apart from each ray by the rounding of
  /// intersecting them with boxes, at least.
  float lower[2], lowerSlope[2], upper[2], upperSlope[2];

  // The same rays for tests of triangles, in L where the octree's positions are: they pass
  // (origin[0], origin[1]) at `height` on the axis.
  double height;
  alignas(64) double origin[2][kSize], slope[2][kSize];
  double error;  ///< L²: cross products of projected corners beyond it have the sign of the exact
};

/// A ray of the beam, and the place in the octree's order of a triangle that its line may meet.
struct RayPair {
  std::uint32_t place, ray;
};

/// The triangles of an octree.
struct BeamElements {
  const Triangle* ordered;  ///< in the octree's order
  const Eigen::Vector3d* positions;
};

/// Handles pairs. Returns the largest w that is still wanted.
using TakePairs = float (*)(void* context, std::span<const RayPair> pairs);

/// Finds the pairs of rays and triangles of which the line may meet the triangle. Nodes and
/// triangles that begin beyond the w that was returned last are skipped. eager: pairs are handled
/// at each node, the nearest nodes first; else in larger parts.
void traverseBeam(const Octree&, const RayBeam&, const BeamElements&, bool eager, void* context,
                  TakePairs);

/// traverseBeam() with take(pairs) in place of the function pointer.
template <class F>
void traverseBeam(const Octree& octree, const RayBeam& beam, const BeamElements& elements,
                  bool eager, F&& take) {
  const auto call = [](void* context, std::span<const RayPair> pairs) {
    return (*static_cast<std::remove_reference_t<F>*>(context))(pairs);
  };
  traverseBeam(octree, beam, elements, eager, &take, call);
}

}  // namespace palpate
