#pragma once

#include "NarrowPhase/NarrowPhase.h"
#include "Math/TriangleIntersection.h"

#include <optional>
#include <span>

namespace palpate {

/// How the surfaces meet in two triangles of the meshes, at the step's start or at its end. Exact.
///
/// Triangles that intersect pierce if one of these rules says so, and touch otherwise:
/// (1) The triangles cross: both have corners strictly on either side of the other's plane, and
///     they have more than one point in common.
/// (2) A corner lies in the other triangle's interior, and the triangles around the corner have
///     vertices strictly on both sides of that triangle; or an edge in the triangle's plane passes
///     through its interior, and the edge's two triangles do.
/// (3) The same with vertices strictly behind the triangle only, if both surfaces are closed: the
///     two bodies overlap. A surface is closed if each edge is in two triangles of one winding.
/// (4) Both surfaces are closed, and the triangles are in one plane, overlap in an area, and have
///     normals of one direction.
///
/// counts: receives exactDecisions and validityPairs, and serves as scratch.
Meeting meetingOf(const MeshPair&, bool atStart, const ElementPair&, ContactBuffers& counts);

/// How the surfaces meet in any of the candidates.
struct SurfaceMeeting {
  Meeting meeting = Meeting::Apart;
  std::optional<ElementPair> piercing{};  ///< the first candidate that pierces
};
/// Stops at the first candidate that pierces.
SurfaceMeeting meetingOf(const MeshPair&, bool atStart, std::span<const ElementPair> candidates,
                         ContactBuffers& counts);

}  // namespace palpate
