#include "Vtk/MeshFile.h"

#include <cmath>

namespace palpate::vtk {

// These files are not read by VTK: its reader splits vertices by their normals and texture
// coordinates.

namespace {

/// Reads the vertex of "7", "7/1", "7//2" or "7/1/2". Positive indices begin at 1; negative indices
/// count back from the newest vertex.
double vertexOf(std::string_view corner, std::size_t vertexCount) {
  const double index = toNumber(corner.substr(0, corner.find('/')));
  if (index != std::floor(index)) throw FileFault{"an index is not a whole number"};
  return index < 0 ? static_cast<double>(vertexCount) + index : index - 1;
}

void readStatement(std::string_view line, Polygons& polygons) {
  FileText text(line.substr(0, line.find('#')));
  const std::string_view keyword = text.word();
  if (keyword == "v") {
    Eigen::Vector3d position;
    for (double& x : position) x = text.number();
    polygons.addPosition(position);
  } else if (keyword == "f") {
    for (std::string_view corner = text.word(); !corner.empty(); corner = text.word())
      polygons.addCorner(vertexOf(corner, polygons.positionCount()));
    polygons.endCell(false);
  }
}

}  // namespace

Polygons readObj(std::string_view content) {
  Polygons polygons;
  FileText text(content);
  for (std::size_t number = 1; text.left() > 0; ++number) {
    const std::size_t first = number;
    std::string statement(text.line());
    for (; statement.ends_with('\\') && text.left() > 0; ++number)
      statement.replace(statement.size() - 1, 1, " ").append(text.line());
    try {
      readStatement(statement, polygons);
    } catch (const FileFault& fault) {
      throw FileFault{"in line " + std::to_string(first) + " " + fault.reason};
    }
  }
  return polygons;
}

}  // namespace palpate::vtk
