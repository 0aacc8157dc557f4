#include "Vtk/FileText.h"
#include "Vtk/MeshFile.h"

namespace palpate::vtk {

// Read here and not by VTK, whose reader splits vertices by their normals and texture coordinates.

namespace {

const NumberType kAny = typeNamed("double");  ///< of no account in a text

/// "7", "7/1", "7//2" or "7/1/2", from 1, or negative: back from the newest vertex.
double vertexOf(std::string_view corner, std::size_t vertexCount) {
  FileText text(corner.substr(0, corner.find('/')));
  const std::int64_t index = text.integer(kAny);
  return static_cast<double>(index < 0 ? static_cast<std::int64_t>(vertexCount) + index
                                       : index - 1);
}

void readStatement(std::string_view line, Polygons& polygons) {
  FileText text(line.substr(0, line.find('#')));
  const std::string_view keyword = text.word();
  if (keyword == "v") {
    for (double& x : polygons.positions.emplace_back()) x = text.number(kAny);
  } else if (keyword == "f") {
    for (std::string_view corner = text.word(); !corner.empty(); corner = text.word())
      polygons.corners.push_back(vertexOf(corner, polygons.positions.size()));
    polygons.ends.push_back(polygons.corners.size());
  }
}

}  // namespace

Polygons readObj(std::string_view content) {
  Polygons polygons;
  FileText text(content);
  for (std::size_t number = 1; text.left() > 0; ++number) {
    std::string statement(text.line());
    const std::size_t first = number;
    while (statement.ends_with('\\') && text.left() > 0) {
      statement.back() = ' ';
      statement += text.line();
      ++number;
    }
    try {
      readStatement(statement, polygons);
    } catch (const FileFault& fault) {
      throw FileFault{"in line " + std::to_string(first) + " " + fault.reason};
    }
  }
  return polygons;
}

}  // namespace palpate::vtk
