#pragma once

#include "MeshFiles/Formats.h"

#include <optional>

namespace palpate::files {

/// Numbers of one type that follow each other in a VTK file.
struct NumberArray {
  FileText text;
  NumberType type;

  double next() { return text.number(type); }
};

/// Cells of a VTK file, by arrays that are read in step.
struct VtkCells {
  std::size_t count;
  NumberArray corners;
  /// For each cell, the end of its corners in `corners`. Without it, each cell's number of corners
  /// stands before them.
  std::optional<NumberArray> ends;
  std::optional<NumberArray> types;  ///< without it, all cells are of this kind:
  Cell kind = Cell::Polygon;
};

void readCells(VtkCells, MeshBuilder&);

/// The number that a VTK file has for a cell of these corners.
enum class VtkType : std::uint8_t { Vertex = 1, Line = 3, Triangle = 5, Tetrahedron = 10 };

/// Calls visit(type, elements) for all kinds of elements.
template <class F>
void forVtkKinds(const MeshArrays& mesh, F&& visit) {
  visit(VtkType::Vertex, pointElements(mesh));
  visit(VtkType::Line, mesh.segments);
  visit(VtkType::Triangle, mesh.triangles);
  visit(VtkType::Tetrahedron, mesh.tetrahedra);
}

}  // namespace palpate::files
