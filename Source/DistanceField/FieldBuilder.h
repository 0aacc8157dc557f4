#pragma once

#include <palpate/DistanceField.h>

#include "DistanceField/FieldCells.h"
#include "Bodies/Body.h"
#include "Core/Threads.h"

namespace palpate {

/// Builds the cells of a field. The geometry is a triangle mesh with an octree that is up to date,
/// and with winding numbers that are unless it is closed; the settings are in range.
///
/// 1. The cells are refined (CellRefinement.h).
/// 2. They are joined, so that neighbours agree where they meet (CellJoining.h). Both steps are
///    repeated while cells have to be split for that.
/// 3. They are numbered, depth first.
FieldCells buildField(const Body&, bool isClosed, const DistanceFieldSettings&, const Threads&);

}  // namespace palpate
