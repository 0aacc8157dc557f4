#pragma once

#include <palpate/Simplify.h>

#include "Simplify/SimplifyBy.h"
#include "Bodies/Body.h"
#include "Core/Threads.h"

namespace palpate {

/// Simplifies a closed mesh in rounds. In each round the mesh is simplified, the result is moved
/// outward, and each of its triangles is tested. Where a test fails, the mesh has a finer level in
/// the next round.
///
/// largest: L, of the mesh's coordinates. The body's octree must be up to date.
/// Errors   UnsupportedMethod or NotAvailable if there is no proof; Cancelled by the progress.
SimplifiedMesh simplifyInRounds(CollapseEdges, const Body&, const SimplifySettings&, double largest,
                                const Threads&);

}  // namespace palpate
