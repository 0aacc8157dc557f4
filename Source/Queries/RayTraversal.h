#pragma once

#include "Octree/Octree.h"
#include "Mesh/TriangleMesh.h"
#include "Math/RayTriangle.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

namespace palpate {

/// A ray in an octree's floats: points origin + t direction with t in [0, tMax].
struct FloatRay {
  std::array<float, 3> origin;
  /// 1 / direction; a very large number for a component of zero.
  std::array<float, 3> inverse;
  float tMax;
  /// Boxes grow by this. It covers every rounding of the ray and of its intersection with a box,
  /// so that a ray enters each box that the exact ray enters, no later.
  float slack;
};

/// The elements of an octree, and the ray as their positions see it.
struct RayElements {
  const Triangle* ordered;  ///< elements in the octree's order
  /// Of the vertices: those of the octree's frame before its shift and scale.
  const Eigen::Vector3d* positions;
  LineFilter line;
};

/// Tests the element at a place of the octree's order. Returns the largest t that is still wanted;
/// a negative number ends the traversal.
using TestElement = float (*)(void* context, std::uint32_t place);

/// A traversal by one ray.
struct RayTask {
  RayElements elements;
  FloatRay ray;
  void* context;
  TestElement test;
};

/// Visits the elements whose boxes the ray meets and that its line may meet. Siblings come in the
/// order in which the ray passes their octants. A node or element is skipped if the ray enters its
/// box beyond the t that was returned last.
/// Source   Revelles, Urena, Lastra, An efficient parametric algorithm for octree traversal (2000),
///          for the order. Difference: cells overlap, so that the ray may meet more than four of
///          eight siblings, and each is tested by its fitted box.
void traverseRay(const Octree&, const RayTask&);

constexpr std::size_t kRaysInFlight = 16;  ///< most tasks of traverseRays()

/// Ends the traversal of tasks[i], if there was one, and makes it the next one. Returns false if
/// there are no more rays.
using NextRay = bool (*)(void* context, std::size_t i);

/// Traverses the octree by many rays, each as traverseRay() does. Several rays take turns, so that
/// the processor loads nodes and elements of some while it tests those of others.
void traverseRays(const Octree&, std::span<const RayTask> tasks, void* context, NextRay);

/// traverseRays() with next(i) in place of the function pointer.
template <class F>
void traverseRays(const Octree& octree, std::span<const RayTask> tasks, F&& next) {
  const auto call = [](void* context, std::size_t i) {
    return (*static_cast<std::remove_reference_t<F>*>(context))(i);
  };
  traverseRays(octree, tasks, &next, call);
}

}  // namespace palpate
