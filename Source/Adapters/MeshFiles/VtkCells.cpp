#include "MeshFiles/VtkCells.h"

#include <algorithm>

namespace palpate::files {

namespace {

struct CellType {
  int type;
  const char* name;
  bool isRead;
  Cell cell = Cell::Points;
  std::size_t corners = 0;  ///< 0: any number
};
constexpr CellType kCellTypes[]{{1, "vertex", true, Cell::Points, 1},
                                {2, "poly-vertex", true, Cell::Points},
                                {3, "line", true, Cell::Polyline, 2},
                                {4, "polyline", true, Cell::Polyline},
                                {5, "triangle", true, Cell::Polygon, 3},
                                {6, "triangle strip", true, Cell::Strip},
                                {7, "polygon", true, Cell::Polygon},
                                {9, "quad", true, Cell::Polygon, 4},
                                {10, "tetrahedron", true, Cell::Tetrahedron, 4},
                                {0, "empty cell", false},
                                {8, "pixel", false},
                                {11, "voxel", false},
                                {12, "hexahedron", false},
                                {13, "wedge", false},
                                {14, "pyramid", false},
                                {15, "pentagonal prism", false},
                                {16, "hexagonal prism", false},
                                {21, "quadratic edge", false},
                                {22, "quadratic triangle", false},
                                {23, "quadratic quad", false},
                                {24, "quadratic tetrahedron", false},
                                {25, "quadratic hexahedron", false},
                                {26, "quadratic wedge", false},
                                {27, "quadratic pyramid", false},
                                {42, "polyhedron", false},
                                {71, "Lagrange tetrahedron", false},
                                {78, "Bezier tetrahedron", false}};

const CellType& cellType(double type, const FileText& at) {
  const auto found =
      std::ranges::find_if(kCellTypes, [&](const CellType& t) { return t.type == type; });
  if (found != std::end(kCellTypes) && found->isRead) return *found;
  const std::string name =
      found != std::end(kCellTypes) ? std::string(" (") + found->name + ")" : "";
  at.refuse("expected vertices, lines, triangles, polygons or tetrahedra, not cell type " +
            shortest(type) + name);
}

/// The number of corners of the next cell, whose numbers are at least `size` bytes each.
std::size_t nextLength(VtkCells& cells, std::size_t& begin, std::size_t size) {
  if (!cells.ends)
    return cells.corners.text.asCount(cells.corners.next(), "corners of a cell", size);
  const double end = cells.ends->next(), start = static_cast<double>(begin);
  if (!(end >= start))
    cells.ends->text.refuse("expected an end of corners from " + shortest(start) + " on, not " +
                            shortest(end));
  const std::size_t length = cells.corners.text.asCount(end - start, "corners of a cell", size);
  begin += length;
  return length;
}

}  // namespace

void readCells(VtkCells cells, MeshBuilder& mesh) {
  FileText& corners = cells.corners.text;
  const std::size_t size = corners.isText() ? 2 : cells.corners.type.size;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < cells.count; ++i) {
    const std::size_t length = nextLength(cells, begin, size);
    Cell kind = cells.kind;
    if (cells.types) {
      const CellType& type = cellType(cells.types->next(), cells.types->text);
      kind = type.cell;
      if (type.corners != 0 && type.corners != length)
        corners.refuse("cell " + std::to_string(i) + " (from 0): expected " +
                       std::to_string(type.corners) + " corners of a " + type.name + ", not " +
                       std::to_string(length));
    }
    mesh.reserveCorners(length);
    for (std::size_t k = 0; k < length; ++k) mesh.addCorner(cells.corners.next(), corners);
    mesh.endCell(kind, corners);
  }
  if (corners.isText() ? !corners.word().empty() : corners.left() > 0)
    corners.refuse("expected no corners after the last cell");
}

}  // namespace palpate::files
