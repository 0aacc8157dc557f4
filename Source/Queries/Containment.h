#pragma once

#include <palpate/ClosedMesh.h>
#include <palpate/Settings.h>

#include "Core/Threads.h"
#include "Queries/SearchableGeometry.h"
#include "Queries/VertexSearch.h"

#include <vector>

namespace palpate {

/// Which vertices of one geometry are inside another: by the winding number about each, counted
/// exactly along a ray, or by solid angles; then the nearest point of the surface. Octrees must be
/// of the positions now, and so must body.windingNumbers for InsideRule::WindingNumber. `out`:
/// ascending vertices.
void findInside(const SearchableGeometry& vertices, const SearchableGeometry& body,
                const InsideSettings&, Engine, const Threads&, VertexSearch<InsideVertex>&,
                std::vector<InsideVertex>& out);

/// Throws NotClosed, with the first edge at fault, where the settings ask for a closed body.
void checkInside(SearchableGeometry& body, const InsideSettings&);

}  // namespace palpate
