#pragma once

#include "Shapes/PlacedShape.h"
#include "Shapes/ShapeContacts.h"
#include "Mesh/TriangleMesh.h"

#include <cstdint>
#include <span>

namespace palpate {

/// Appends a contact for each of the given elements that comes nearer to a shape than a StepGuard
/// lets it, at the first time at which it does: within its largest radius, or if it begins nearer
/// than that, nearer than it began, as findNearing() does. An element that begins in a box, hull,
/// cylinder or turning plane is reported at time 0. The contact's element is a Face with the
/// element's number.
void findShapeNearings(const TriangleMesh&, const PlacedShape&, double timeTolerance,
                       std::span<const std::uint32_t> elements, ShapeContactBuffers& out);
/// The same for two shapes.
void findShapePairNearing(const PlacedShape& a, const PlacedShape& b, double timeTolerance,
                          ShapeContactBuffers& out);

}  // namespace palpate
