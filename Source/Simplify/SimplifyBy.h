#pragma once

#include <palpate/Export.h>
#include <palpate/Simplify.h>
#include <palpate/Types.h>

#include <span>
#include <vector>

namespace palpate {

/// Collapses edges of triangles. Corners of the result are corners of the triangles. Edges of one
/// triangle only stay as they are. error: L, about how far the surface may move; no bound.
using CollapseEdges = std::vector<Triangle> (*)(std::span<const Eigen::Vector3d> positions,
                                                std::span<const Triangle>, double error);

/// simplify() by any way of collapsing edges: the certificate does not depend on it. Exported for
/// Palpate::Simplify.
PALPATE_EXPORT SimplifiedMesh simplifyBy(CollapseEdges, const TriangleMeshView&,
                                         const SimplifySettings&);

}  // namespace palpate
