#pragma once

#include "Math/ImpactFilter.h"
#include "Math/ImpactQuery.h"

#include <array>
#include <cstdint>

namespace palpate {

/// What findPassages() finds for the queries of a block. Bit i is for lane i.
struct BlockPassages {
  std::uint8_t isKnown;          ///< the lane has one passage at most; others need findPassages()
  std::uint8_t passes, forward;  ///< of the known lanes
  std::array<double, ImpactBlock::kLanes> times;  ///< of the lanes that pass
};

/// Decides most queries without exact arithmetic.
/// Law      what is known of a lane has the same bits as the answer of findPassages().
/// Cost     some 30 nanoseconds a query.
BlockPassages findPassages(ImpactQuery::Kind, const ImpactBlock&, double tolerance);

}  // namespace palpate
