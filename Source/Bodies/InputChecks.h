#pragma once

#include <palpate/Types.h>

#include "Bodies/Body.h"
#include "Mesh/Motion.h"
#include "Mesh/TetrahedralTopology.h"
#include "Core/Threads.h"

#include <Eigen/Geometry>

#include <span>
#include <string>

namespace palpate {

// Checks of the user's input. Each function throws an Error that describes the fault.

/// Copies the positions of vertices from `first` on to `out` while checking them, and returns their
/// bounds. which: " before", " now" or nothing, for the message. If `before` is given, `moved`
/// receives the motion from there; this costs half as much as reading both arrays again.
Eigen::AlignedBox3d checkPositions(const GeometryLabel&, std::span<const Eigen::Vector3d>,
                                   Eigen::Vector3d* out, const char* which, const Threads&,
                                   const Eigen::Vector3d* before = nullptr,
                                   MotionRange* moved = nullptr, std::size_t first = 0);
/// Returns a copy of the positions of a new topology.
CountedVector<Eigen::Vector3d> checkedRest(const GeometryLabel&, std::span<const Eigen::Vector3d>);
/// first: the id of the first triangle.
void checkCounts(const GeometryLabel&, std::size_t vertexCount, std::span<const Triangle>,
                 GeometryType, std::size_t first = 0);
/// first: the id of the first tetrahedron.
void checkTetrahedra(const GeometryLabel&, std::size_t vertexCount, std::span<const Tetrahedron>,
                     std::size_t first = 0);
[[noreturn]] void refuse(const GeometryLabel&, const OverusedFace&);
/// removed: ascending; they count as absent.
TetrahedralTopology checkedTopology(const GeometryLabel&, std::span<const Eigen::Vector3d> rest,
                                    std::span<const Tetrahedron>,
                                    std::span<const std::uint32_t> removed = {});
/// The ids that a cut removes, of `count`, ascending. element: for the message.
CountedVector<std::uint32_t> checkedRemoval(const GeometryLabel&, const std::string& element,
                                            std::size_t count,
                                            std::span<const std::uint32_t> removedBefore,
                                            std::span<const std::uint32_t> removed);
void checkRadii(const GeometryLabel&, std::span<const double>);
void checkOnePerVertex(const GeometryLabel&, std::span<const Eigen::Vector3d>,
                       std::span<const double> radii);
/// Throws unless the vertex is one of `count`.
void checkVertex(const GeometryLabel&, std::uint32_t vertex, std::size_t count);

}  // namespace palpate
