#pragma once

#include "Mesh/FloatPositions.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"

#include <cstdint>
#include <span>

namespace palpate {

/// The bits that describe how a triangle appears along the coordinate axes.
struct ViewBit {
  /// Along the axis, the triangle is visible from above, or from below, during the whole step.
  static constexpr std::uint32_t fromAbove(int axis) { return 1u << axis; }
  static constexpr std::uint32_t fromBelow(int axis) { return 1u << (3 + axis); }
  /// Going from the next corner to the last one, the coordinate rises to this corner's value or
  /// beyond.
  static constexpr std::uint32_t comesUp(int corner, int axis) {
    return 1u << (6 + 3 * corner + axis);
  }
};

/// Finds triangles around vertices that certainly meet only in the vertex and in their common
/// edges, at any time of the step. In a smooth mesh, most neighbours are such triangles.
///
/// The star of a vertex, the triangles around it, is unfolded if two conditions hold along one of
/// the axes: all its triangles are always visible from the same side, and it goes once around the
/// vertex. The projected triangles then lie side by side, and so do the triangles. Projected areas
/// are quadratics of the time with three coefficients in Bernstein form. Their signs must be
/// certain despite their rounding errors and those of the floats. All positions that those errors
/// allow therefore go around the vertex as often as the floats at the step's start, which
/// comparisons count. (After the normal cones of Tang, Curtis, Yoon, Manocha: Interactive
/// continuous collision detection between deformable models using connectivity-based culling, SPM
/// 2008; a star's contour needs no test of its own.)
class UnfoldedStars {
 public:
  /// order: the ids of the triangles that were not removed. ordered: they in this order, in which
  /// triangles() returns them. before and now: floats of one frame, at the ends of the step.
  void find(const MeshTopology&, std::span<const std::uint32_t> order,
            std::span<const Triangle> ordered, const FloatPoint* before, const FloatPoint* now,
            const Threads&);

  /// The ordered triangles, readable BoxArrays::kPadding past their end. Each vertex whose star is
  /// not unfolded is replaced by a unique number. Two triangles that still share a number need no
  /// test.
  const Triangle* triangles() const { return m_triangles.data(); }

 private:
  Buffer<std::uint32_t> m_views;  ///< for each triangle: a set of ViewBit
  Buffer<std::uint8_t> m_unfolded;
  Buffer<Triangle> m_triangles;
};

}  // namespace palpate
