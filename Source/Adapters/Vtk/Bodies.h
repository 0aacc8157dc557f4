#pragma once

#include <palpate/Capture.h>
#include <palpate/vtk/Window.h>

#include <cstdint>
#include <map>
#include <optional>

class vtkProp;
class vtkRenderer;

namespace palpate::vtk {

/// Appearances of the parts of a geometry, each by its first element.
using Parts = std::map<std::uint32_t, Appearance>;

/// The appearance of the geometry at this index in the problem, unless the user chose another.
Appearance usualAppearance(std::size_t index);

/// Gives a shape a mesh: the furthest points along directions all around. size: L, of a plane.
void tessellate(CollisionProblem::Geometry& shape, double size);

/// Adds a body to the renderer, or returns null for an invisible one. Each cell has the id of its
/// element in the cell array "element". section: what is out of its half-space is cut off.
/// thinnest: L, the least radius with which lines are drawn. pixelsPerLength: of the picture.
vtkProp* addBody(vtkRenderer*, const CollisionProblem::Geometry&, const Parts&,
                 const std::optional<Plane>& section, double thinnest, double pixelsPerLength);

}  // namespace palpate::vtk
