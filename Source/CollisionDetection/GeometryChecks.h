#pragma once

#include "CollisionDetection/GeometryTable.h"
#include "Core/Threads.h"
#include "Mesh/TetrahedralTopology.h"

#include <span>
#include <vector>

namespace palpate {

// What users hand in: each throws what is wrong with it.

/// Copied to `out` while checked. which: " before", " now" or nothing, for the message. moved: from
/// `before`, if that is given, while they are at hand; half of what reading both again costs.
void checkPositions(GeometryId, std::span<const Eigen::Vector3d>, Eigen::Vector3d* out,
                    const char* which, const Threads&, const Eigen::Vector3d* before = nullptr,
                    MotionRange* moved = nullptr);
/// Positions of a new topology, copied.
std::vector<Eigen::Vector3d> checkedRest(GeometryId, std::span<const Eigen::Vector3d>);
void checkCounts(GeometryId, std::span<const Eigen::Vector3d>, std::span<const Triangle>,
                 GeometryKind);
TetrahedralTopology checkedTopology(GeometryId, std::span<const Eigen::Vector3d> rest,
                                    std::span<const Tetrahedron>);
void checkRadii(GeometryId, std::span<const double>);
void checkOnePerVertex(GeometryId, std::span<const Eigen::Vector3d>, std::span<const double> radii);
void checkPositionCount(const Geometry&, std::size_t count);
/// Of positions in a body's frame.
void checkPlaceable(GeometryId, std::span<const Eigen::Vector3d> body, ErrorCode);

}  // namespace palpate
