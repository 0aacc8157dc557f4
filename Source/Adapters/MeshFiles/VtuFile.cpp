// Part of MeshFiles/Formats.h: VTU files.

#include "MeshFiles/Formats.h"
#include "MeshFiles/XmlArrays.h"

// Source: "VTK File Formats", Kitware: the XML format of unstructured grids.

namespace palpate::files {

namespace {

void readGrid(XmlArrays& file, std::string_view piece, MeshBuilder& mesh) {
  const std::size_t first = mesh.positionCount(), points = file.count(piece, "NumberOfPoints");
  if (points > 0) {
    NumberArray array = file.array(piece, "Points", "");
    mesh.readPositions(array.text, array.type, points);
  }
  mesh.useVertices(first, points);
  if (const std::size_t cells = file.count(piece, "NumberOfCells"))
    readCells({cells, file.array(piece, "Cells", "connectivity"),
               file.array(piece, "Cells", "offsets"), file.array(piece, "Cells", "types")},
              mesh);
}

}  // namespace

void readVtu(FileText text, MeshBuilder& mesh) {
  XmlArrays file(text);
  file.forPieces("UnstructuredGrid", [&](std::string_view piece) { readGrid(file, piece, mesh); });
}

std::string writeVtu(const MeshArrays& mesh, const MeshWriteSettings& settings) {
  std::size_t cells = 0, corners = 0;
  const auto forCells = [&](auto&& visit) {
    forVtkKinds(mesh, [&](VtkType type, const auto& elements) {
      for (const auto& element : elements) visit(type, element);
    });
  };
  forCells([&](VtkType, const auto& cell) {
    ++cells;
    corners += cell.size();
  });
  XmlOutput out("UnstructuredGrid", settings.binary);
  out.start({{"NumberOfPoints", mesh.positions.size()}, {"NumberOfCells", cells}});
  out.addPositions(mesh.positions);
  out.openGroup("Cells");
  out.addArray<std::int64_t>("Int64", "connectivity", 1, corners, [&](Output& array) {
    forCells([&](VtkType, const auto& cell) { array.template numbers<std::int64_t>(cell); });
  });
  out.addArray<std::int64_t>("Int64", "offsets", 1, cells, [&](Output& array) {
    std::int64_t end = 0;
    forCells([&](VtkType, const auto& cell) {
      array.number(end += static_cast<std::int64_t>(cell.size()));
    });
  });
  out.addArray<std::uint8_t>("UInt8", "types", 1, cells, [&](Output& array) {
    forCells([&](VtkType type, const auto&) { array.number(static_cast<std::uint8_t>(type)); });
  });
  out.closeGroup("Cells");
  return out.finish();
}

}  // namespace palpate::files
