#pragma once

#include "CollisionDetection/GeometryTable.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace palpate {

// Checks of calls that change a geometry. Each function throws an Error that describes the fault.

/// Throws unless the field is of this mesh, which may have one.
void checkAttachable(const Geometry&, const DistanceField&);
void checkProxy(const Geometry&, const SurfaceProxySettings&);
/// Throws if a distance field or leaves, which are of its shape, are attached to the geometry.
/// call: for the message.
void checkShapeMayChange(const Geometry&, const char* call);
void checkName(const Body&, const std::string& name);
void checkFilter(const Geometry&, const CollisionFilter&);
void checkElements(const Geometry&, std::span<const std::uint32_t> elements);
void checkTags(const Body&, std::size_t count);
void checkPositionCount(const Geometry&, std::size_t count);
/// The same for the vertices from `first` on, which may be fewer than all.
void checkPositionCount(const Geometry&, std::size_t first, std::size_t count);

}  // namespace palpate
