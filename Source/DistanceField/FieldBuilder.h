#pragma once

#include <palpate/DistanceField.h>

#include "DistanceField/FieldCells.h"
#include "Bodies/Body.h"
#include "Core/Threads.h"

namespace palpate {

/// Builds the cells of a field. The geometry is a triangle mesh with an octree that is up to date,
/// and with winding numbers that are unless it is closed; the settings are in range.
///
/// 0. Unless the mesh is closed: a cell has a reliable sign, or its values have none.
/// 1. Cells are refined, many at a time: evaluate the distance at corners that are new, keep a cell
///    if its error is certainly small or if it is beyond the band, else split it.
/// 2. A corner of a cell that lies on the border of a larger cell hangs: it takes the value that
///    the larger cell interpolates there. Larger cells are split until no hanging value is off by
///    more than its share of the error bound.
/// 3. The cells are numbered, depth first.
FieldCells buildField(const Body&, bool isClosed, const DistanceFieldSettings&, const Threads&);

}  // namespace palpate
