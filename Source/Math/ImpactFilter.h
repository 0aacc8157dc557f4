#pragma once

#include "Math/ImpactQuery.h"
#include "Core/Assert.h"

#include <cstdint>

namespace palpate {

/// Eight queries of one kind, side by side. Lanes that hold no query may hold any finite numbers.
struct ImpactBlock {
  static constexpr int kLanes = 8;
  alignas(64) double positions[4][2][3][kLanes] = {};  ///< vertex, end of the step, coordinate

  void set(int lane, int vertex, const Eigen::Vector3d& before, const Eigen::Vector3d& now) {
    PALPATE_ASSERT(lane >= 0 && lane < kLanes && vertex >= 0 && vertex < 4);
    for (int k = 0; k < 3; ++k) {
      positions[vertex][0][k][lane] = before[k];
      positions[vertex][1][k][lane] = now[k];
    }
  }
};

/// Filters out most queries without an impact. Bit i is clear only if findImpact() with these
/// settings certainly finds no impact. It is set if findImpact() may find one.
/// Needs    a tolerance in [2^-50, 1].
/// Cost     a few tens of nanoseconds a query.
std::uint8_t mayImpact(ImpactQuery::Kind, const ImpactBlock&, const TimeOfImpactSettings&);

}  // namespace palpate
