#pragma once

#include "Core/Buffer.h"
#include "Core/Threads.h"
#include "Mesh/FloatPositions.h"
#include "Mesh/TriangleMesh.h"

#include <cstdint>
#include <span>

namespace palpate {

/// The bits of a triangle's view.
struct ViewBit {
  /// Along the axis, the triangle is seen from above, or from below, during the whole step.
  static constexpr std::uint32_t fromAbove(int axis) { return 1u << axis; }
  static constexpr std::uint32_t fromBelow(int axis) { return 1u << (3 + axis); }
  /// From the next corner to the last, the coordinate comes up to this corner's or beyond.
  static constexpr std::uint32_t comesUp(int corner, int axis) {
    return 1u << (6 + 3 * corner + axis);
  }
};

/// Triangles around vertices that certainly meet nowhere but in the vertex and in their common
/// edges, at any time of the step: most of a smooth mesh's neighbours.
///
/// The star of a vertex, the triangles around it, is unfolded if along one of the axes all of it is
/// always seen from the same side, and goes once around the vertex. What is seen lies side by side
/// then, and so do the triangles. Areas as seen are quadratics of the time with three coefficients
/// in Bernstein form, of one sign beyond their rounding errors and those of the floats; so all
/// positions that those errors allow go around the vertex as often as the floats themselves, at the
/// step's start, which comparisons count. (After the normal cones of Tang, Curtis, Yoon, Manocha:
/// Interactive continuous collision detection between deformable models using connectivity-based
/// culling, SPM 2008; a star's contour needs no test of its own.)
class UnfoldedStars {
 public:
  /// ordered: the triangles in the order that they are asked for in; before and now: floats of one
  /// frame, at the ends of the step.
  void find(const MeshTopology&, std::span<const Triangle> ordered, const FloatPoint* before,
            const FloatPoint* now, const Threads&);

  /// The ordered triangles, readable BoxArrays::kPadding past their end, each vertex whose star is
  /// not unfolded replaced by a number of its own: two that have one in common need no test.
  const Triangle* triangles() const { return m_triangles.data(); }

 private:
  Buffer<std::uint32_t> m_views;  ///< of each triangle: ViewBit
  Buffer<std::uint8_t> m_unfolded;
  Buffer<Triangle> m_triangles;
};

}  // namespace palpate
