#pragma once

#include "NarrowPhase/FeaturePairs.h"
#include "NarrowPhase/FeatureTests.h"
#include "Core/Assert.h"

#include <Eigen/Core>

#include <bit>
#include <cstdint>
#include <span>

namespace palpate {

/// Finds pairs of triangles of one mesh that are near each other at a common vertex only. Around a
/// vertex with n triangles all n² / 2 pairs are candidates, because their boxes meet there.
///
/// Two triangles have one vertex in common. Every feature pair without it then has a feature of
/// the edge opposite to it in one of the triangles. None of these pairs is near if the box of that
/// edge of each triangle is apart from the box of the other triangle.
class SharedVertex {
 public:
  /// floats: of one mesh with itself; the shift has the thickness. Null: no pair is alone.
  /// pairs: those of one batch. The test pays only at vertices of many triangles, so that it is
  /// used if some triangles of a sample of the pairs have one.
  SharedVertex(const MeshTopology& topology, const FloatPair* floats,
               std::span<const ElementPair> pairs) {
    PALPATE_ASSERT(!floats || floats->a == floats->b);
    if (!floats || !anyIsCrowded(topology, pairs)) return;
    m_floats = floats->a;
    m_reach = (1.0f + 0x1p-20f) *
              Lanes::Map(floats->shiftUpper.data()).max(-Lanes::Map(floats->shiftLower.data()));
  }

  bool isUsed() const { return m_floats; }

  /// Whether all feature pairs of a and b without a common vertex are further apart at the step's
  /// end than the thickness. same: sameCorners(a, b). False if not exactly one vertex is common.
  bool isAlone(const Triangle& a, const Triangle& b, unsigned same) const {
    if (!isUsed() || !std::has_single_bit(same)) return false;
    const int pair = std::countr_zero(same);
    const Bounds first(m_floats, a, kCornerOfA[pair]), second(m_floats, b, kCornerOfB[pair]);
    // Each float is off by 2^-24 of its size and 2^-150, and each difference by 2^-24 of twice the
    // larger size. Together they are below a half of this margin.
    const Lanes size = first.size().max(second.size());
    const Lanes reach = m_reach + 0x1p-20f * size + OutwardRounding::kAbsolute;
    return first.isOppositeEdgeApart(second, reach) && second.isOppositeEdgeApart(first, reach);
  }

 private:
  using Lanes = Eigen::Array4f;

  static bool anyIsCrowded(const MeshTopology& topology, std::span<const ElementPair> pairs) {
    constexpr std::size_t kSample = 16, kMany = 64;
    const std::size_t stride = pairs.size() / kSample + 1;
    for (std::size_t i = 0; i < pairs.size(); i += stride)
      for (const std::uint32_t vertex : topology.elements[pairs[i].a])
        if (topology.vertexTriangles[vertex].size() > kMany) return true;
    return false;
  }

  struct Bounds {
    Lanes edgeLower, edgeUpper;  ///< of the edge opposite to the common vertex
    Lanes lower, upper;          ///< of the triangle

    Bounds(const FloatPoint* floats, const Triangle& corners, int common) {
      const auto at = [&](int i) { return Lanes::MapAligned(&floats[corners[i % 3]].x); };
      edgeLower = at(common + 1).min(at(common + 2));
      edgeUpper = at(common + 1).max(at(common + 2));
      lower = edgeLower.min(at(common));
      upper = edgeUpper.max(at(common));
    }
    Lanes size() const { return upper.max(-lower); }
    bool isOppositeEdgeApart(const Bounds& other, const Lanes& reach) const {
      const Lanes gap = (edgeLower - other.upper).max(other.lower - edgeUpper);
      return (gap - reach).maxCoeff() > 0.0f;
    }
  };

  const FloatPoint* m_floats = nullptr;
  Lanes m_reach;
};

}  // namespace palpate
