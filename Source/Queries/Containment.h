#pragma once

#include <palpate/Meshes.h>
#include <palpate/Settings.h>

#include "Queries/VertexSearch.h"
#include "Bodies/Body.h"
#include "Core/Threads.h"

#include <vector>

namespace palpate {

/// Finds the vertices of one geometry that are inside another, and the nearest point of its surface
/// for each. InsideRule::Closed counts the winding number about a vertex exactly along a ray, or
/// searches the tetrahedra of a solid. InsideRule::WindingNumber sums solid angles. The octrees
/// must be up to date with the positions now, and so must body.windingNumbers for
/// InsideRule::WindingNumber. `out`: ascending vertices.
void findInside(const Body& vertices, const Body& body, const InsideSettings&, Engine,
                const Threads&, VertexSearch<InsideVertex>&, std::vector<InsideVertex>& out);

/// Whether a point is inside a body, with the same conditions.
bool isInside(const Body& body, const Eigen::Vector3d& point, const InsideSettings&, Engine,
              PointQueryStack&);

/// The winding number of a geometry's surface about a point, decided exactly; 0 on the surface.
int windingNumber(const Body&, const Eigen::Vector3d& point, Engine, PointQueryStack&);

/// Throws InvalidSettings for settings out of range.
void checkSettings(const Body& body, const InsideSettings&);
/// Throws NotClosed for a body without faces. For InsideRule::Closed it also throws NotClosed, with
/// the first edge at fault, if the body is not closed.
void checkInside(const Body& body, InsideRule);
/// Whether checkInside() accepts a body with elements for InsideRule::Closed.
bool isClosed(const Body& body);
/// Whether a body's triangles are closed and consistently oriented. Those of a tetrahedral mesh are
/// not where parts of it hang together by an edge alone.
bool hasClosedSurface(const Body& body);

}  // namespace palpate
