#pragma once

#include "Queries/BodyPair.h"
#include "Mesh/Corners.h"
#include "Core/CountedVector.h"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

namespace palpate {

struct SweepInset;

/// The triangles of a body with area, along a space-filling curve, and boxes over parts of them:
/// a complete binary tree, in which node i has the children 2 i and 2 i + 1. The leaves hold kLeaf
/// triangles each. Coordinates are in units of the caller.
///
/// Source   Lauterbach et al., Fast BVH construction on GPUs (2009): a tree over a sorted order.
struct SweepTree {
  /// Along the coordinate axes, and along one more direction.
  struct Box {
    std::array<double, 4> lower, upper;
    double size() const {
      return (upper[0] - lower[0]) + (upper[1] - lower[1]) + (upper[2] - lower[2]);
    }
  };
  struct Hit {
    double t;
    std::uint32_t element;
  };
  static constexpr std::size_t kLeaf = 4;

  /// unit: 1/L.
  void load(const MeshTopology&, const BodyVertices&, double unit);
  /// axis: the further direction of the boxes. inset: if not null, the boxes also enclose these
  /// triangles, and their reflections in the tree's own.
  void makeBoxes(const Eigen::Vector3d& axis, const SweepInset*);
  /// The triangles of a leaf: from the first place to before the second.
  std::pair<std::size_t, std::size_t> trianglesOf(std::uint32_t leaf) const {
    const std::size_t begin = (leaf - leaves) * kLeaf;
    return {std::min(begin, corners.size()), std::min(begin + kLeaf, corners.size())};
  }
  /// Where a ray meets a triangle first, within rounding. None if it does not, or not before `end`.
  std::optional<Hit> firstHit(const Eigen::Vector3d& start, const Eigen::Vector3d& along,
                              double end) const;

  CountedVector<std::pair<std::uint32_t, std::uint32_t>> order;  ///< place on the curve, element
  CountedVector<Corners> corners;
  CountedVector<Box> own;    ///< of the triangles
  CountedVector<Box> boxes;  ///< by node, from 1 on
  std::size_t leaves = 0;
};

/// The triangles of a SweepTree, moved inward by a depth.
struct SweepInset {
  static constexpr double kMost = 16.0;  ///< a vertex moves at most so many depths

  /// depth: in units.
  void make(const SweepTree&, const MeshTopology&, const BodyVertices&, double unit, double depth);

  CountedVector<Corners> triangles;  ///< in the tree's order
  CountedVector<Eigen::Vector3d> normals, vertices;
};

}  // namespace palpate
