#pragma once

#include <cstdint>

namespace palpate {

/// Triangle pairs side by side, for SIMD across pairs.
struct TrianglePairBatch {
  static constexpr int kSize = 16;
  static constexpr int kRows = 18;
  /// The row of a coordinate of a triangle's corner.
  static constexpr int rowOfA(int corner, int axis) { return 3 * corner + axis; }
  static constexpr int rowOfB(int corner, int axis) { return 9 + 3 * corner + axis; }
  alignas(64) double coordinates[kRows][kSize];
};

/// Finds the feature pairs of each triangle pair that may be within the thickness. All others are
/// proven to be further apart.
///
/// Shapes   possible: per pair, a set of the tests in NarrowPhase/FeatureTests.h.
/// distinct: also drops edge pairs whose closest points are proven not to be inside both edges,
/// except those that may be at most checkedEdgeDistance apart.
/// Errors   none; where coordinates overflow or underflow, no feature pair is dropped.
void findPossibleProximity(const TrianglePairBatch&, double thickness, bool distinct,
                           double checkedEdgeDistance,
                           std::uint32_t (&possible)[TrianglePairBatch::kSize]);

}  // namespace palpate
