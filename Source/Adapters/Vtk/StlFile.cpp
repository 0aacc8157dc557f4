#include "Vtk/MeshFile.h"

#include <array>
#include <map>

namespace palpate::vtk {

// These files are not read by VTK: its reader drops facets without area, and trusts a binary file's
// count.

namespace {

/// Reads three coordinates after each "vertex". A file that does not end with "endsolid" is
/// truncated.
std::vector<double> readText(FileText text) {
  std::vector<double> coordinates;
  bool ended = false;
  for (std::string_view word = text.word(); !word.empty(); word = text.word()) {
    ended = word == "endsolid";
    if (ended || word == "solid") text.line();  // its name
    if (word != "vertex") continue;
    for (int i = 0; i < 3; ++i) coordinates.push_back(text.number());
  }
  if (!ended) throw FileFault{"it is truncated"};
  return coordinates;
}

/// Reads facets of 50 bytes after a header: a normal, three corners and two more bytes.
std::vector<double> readBinary(FileText facets) {
  const NumberType real = typeNamed("float");
  std::vector<double> coordinates;
  facets.take(80);
  for (double left = facets.number(typeNamed("uint")); left > 0; --left) {
    facets.take(12);
    for (int i = 0; i < 9; ++i) coordinates.push_back(facets.number(real));
    facets.take(2);
  }
  return coordinates;
}

}  // namespace

Polygons readStl(std::string_view content) {
  const bool text =
      content.starts_with("solid") && content.substr(0, 1024).find("facet") != content.npos;
  Polygons corners, polygons;
  corners.addPositions(text ? readText(FileText(content))
                            : readBinary(FileText(content, Encoding::LittleEndian)));
  std::map<std::array<double, 3>, double> vertices;
  for (std::size_t i = 0; i < corners.positions.size(); ++i) {
    const Eigen::Vector3d& p = corners.positions[i];
    if (!p.allFinite()) return corners;  // the checks of all formats refuse these positions
    const double next = static_cast<double>(polygons.positions.size());
    const auto [vertex, isNew] = vertices.try_emplace({p.x(), p.y(), p.z()}, next);
    if (isNew) polygons.positions.push_back(p);
    if (i % 3 == 0) polygons.corners.emplace_back();
    polygons.corners.back().push_back(vertex->second);
  }
  return polygons;
}

}  // namespace palpate::vtk
