#pragma once

#include "Queries/BodyPair.h"
#include "Queries/SweepFrame.h"
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

/// The triangles of a body with area, and boxes over parts of them: a complete binary tree, in
/// which node i has the children 2 i and 2 i + 1. The leaves hold up to kLeaf triangles each.
/// Coordinates are those of the frame.
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

  void load(const MeshTopology&, const BodyVertices&, const SweepFrame&);
  /// axis: the further direction of the boxes. inset: if not null, the boxes also enclose these
  /// triangles; if closed, also their reflections in the tree's own.
  void makeBoxes(const Eigen::Vector3d& axis, const SweepInset*, bool closed);
  /// The triangles of a leaf: from the first place to before the second.
  std::pair<std::size_t, std::size_t> trianglesOf(std::uint32_t leaf) const {
    return {placeOf(leaf - leaves), placeOf(leaf - leaves + 1)};
  }
  /// Where a ray meets a triangle first, within rounding. None if it does not, or not before `end`.
  std::optional<Hit> firstHit(const Eigen::Vector3d& start, const Eigen::Vector3d& along,
                              double end) const;

  struct Place {
    Eigen::Vector3d middle;   ///< of the triangle's box, doubled
    Eigen::Vector3d extents;  ///< of the triangle's box
    std::uint32_t element;
  };
  CountedVector<Place> order;
  CountedVector<Corners> corners;
  CountedVector<Box> own;    ///< of the triangles
  CountedVector<Box> boxes;  ///< by node, from 1 on
  std::size_t leaves = 0;

 private:
  /// The place of a leaf's first triangle.
  std::size_t placeOf(std::size_t leaf) const { return std::min(leaf * kLeaf, order.size()); }
  void divide(std::size_t leaf, std::size_t count);
};

/// The triangles of a SweepTree, moved inward by a depth.
struct SweepInset {
  static constexpr double kMost = 16.0;  ///< a vertex moves at most so many depths

  /// depth: in units.
  void make(const SweepTree&, const MeshTopology&, const BodyVertices&, const SweepFrame&,
            double depth);

  CountedVector<Corners> triangles;  ///< in the tree's order
  CountedVector<Eigen::Vector3d> normals, vertices;
};

}  // namespace palpate
