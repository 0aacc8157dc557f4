#pragma once

#include "DistanceField/CellCertifier.h"
#include "DistanceField/CellTree.h"
#include "Core/Threads.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// Makes the values of neighbouring cells agree where they meet, after cells from `first` on were
/// refined. A corner of a cell that lies on the border of a larger cell hangs: it takes the value
/// that the larger cell interpolates there.
///
/// Returns the cells that have to be split, because values that hang on them are too far off.
std::vector<std::uint32_t> joinCells(CellTree&, std::size_t first, const CellCertifier&,
                                     const Threads&);

}  // namespace palpate
