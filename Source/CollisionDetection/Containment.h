#pragma once

#include <palpate/ClosedMesh.h>
#include <palpate/Settings.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/VertexSearch.h"
#include "CollisionDetection/WindingNumber.h"
#include "Core/Threads.h"

#include <span>

namespace palpate {

/// Which vertices of one geometry are inside another: by the winding number of each, counted
/// exactly along a ray, or by solid angles; then the nearest point of the surface. Scratch that
/// remembers its peak.
class Containment {
 public:
  /// Octrees must be of the positions now. Ascending vertices; the span lives until the next call.
  std::span<const InsideVertex> find(const Geometry& vertices, const Geometry& body,
                                     const InsideSettings&, Engine, const Threads&);

 private:
  VertexSearch<InsideVertex> m_search;
  WindingNumbers m_numbers;
};

/// Throws NotClosed, with the first edge at fault, where the settings ask for a closed body.
void checkInside(Geometry& body, const InsideSettings&);

}  // namespace palpate
