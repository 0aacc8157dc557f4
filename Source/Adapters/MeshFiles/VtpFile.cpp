// Part of MeshFiles/Formats.h: VTP files.

#include "MeshFiles/Formats.h"
#include "MeshFiles/XmlArrays.h"

#include <string>

// Source: "VTK File Formats", Kitware: the XML format of polygonal data.

namespace palpate::files {

namespace {

struct Group {
  std::string_view name;
  Cell kind;
};
constexpr Group kGroups[]{{"Verts", Cell::Points},
                          {"Lines", Cell::Polyline},
                          {"Polys", Cell::Polygon},
                          {"Strips", Cell::Strip}};

void readPolyData(XmlArrays& file, std::string_view piece, MeshBuilder& mesh) {
  const std::size_t first = mesh.positionCount(), points = file.count(piece, "NumberOfPoints");
  if (points > 0) {
    NumberArray array = file.array(piece, "Points", "");
    mesh.readPositions(array.text, array.type, points);
  }
  mesh.useVertices(first, points);
  for (const Group& group : kGroups)
    if (const std::size_t cells = file.count(piece, "NumberOf" + std::string(group.name)))
      readCells({cells,
                 file.array(piece, group.name, "connectivity"),
                 file.array(piece, group.name, "offsets"),
                 {},
                 group.kind},
                mesh);
}

}  // namespace

void readVtp(FileText text, MeshBuilder& mesh) {
  XmlArrays file(text);
  file.forPieces("PolyData", [&](std::string_view piece) { readPolyData(file, piece, mesh); });
}

std::string writeVtp(const MeshArrays& mesh, const MeshWriteSettings& settings) {
  XmlOutput out("PolyData", settings.binary);
  out.start({{"NumberOfPoints", mesh.positions.size()},
             {"NumberOfVerts", mesh.points.size()},
             {"NumberOfLines", mesh.segments.size()},
             {"NumberOfStrips", 0},
             {"NumberOfPolys", mesh.triangles.size()}});
  out.addPositions(mesh.positions);
  std::size_t next = 0;
  forVtkKinds(mesh, [&](VtkType type, const auto& elements) {
    if (type == VtkType::Tetrahedron) return;
    const std::string_view group = kGroups[next++].name;
    const std::size_t corners = elements.empty() ? 0 : elements[0].size();
    out.openGroup(group);
    out.addArray<std::int64_t>("Int64", "connectivity", 1, corners * elements.size(),
                               [&](Output& array) {
                                 for (const auto& element : elements)
                                   array.template numbers<std::int64_t>(element);
                               });
    out.addArray<std::int64_t>("Int64", "offsets", 1, elements.size(), [&](Output& array) {
      for (std::size_t i = 1; i <= elements.size(); ++i)
        array.number(static_cast<std::int64_t>(i * corners));
    });
    out.closeGroup(group);
  });
  return out.finish();
}

}  // namespace palpate::files
