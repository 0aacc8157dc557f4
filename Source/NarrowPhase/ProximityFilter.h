#pragma once

#include <cstdint>

namespace palpate {

/// Triangle pairs side by side, for SIMD across pairs.
struct TrianglePairBatch {
  static constexpr int kSize = 16;
  /// Row 3 corner + axis; corners 0 to 2 are triangle a's, 3 to 5 triangle b's.
  alignas(64) double coordinates[18][kSize];
};

/// Which feature pairs of each triangle pair may be within the thickness. Those left out are proven
/// not to be.
///
/// Shapes   possible: per pair, bit i: corner i of a against b; bit 3 + j: corner j of b against a; bit
///          6 + 3 i + j: edge i of a against edge j of b.
/// distinct leaves out edges, too, whose closest points are proven not to lie inside both; but
/// keeps those that may be at most edgeReach apart.
/// Errors   none; where coordinates over- or underflow nothing is left out.
void findPossibleProximity(const TrianglePairBatch&, double thickness, bool distinct,
                           double edgeReach, std::uint32_t (&possible)[TrianglePairBatch::kSize]);

}  // namespace palpate
