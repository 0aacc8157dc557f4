#include "Vtk/MeshFile.h"

#include <palpate/AnalyticalGeometry.h>
#include <palpate/Types.h>

#include <algorithm>
#include <vector>

namespace palpate::vtk {

// These files are not read by VTK: its reader drops facets without area, and trusts a binary file's
// count.

namespace {

/// Reads three coordinates after each "vertex". A file that does not end with "endsolid" is
/// truncated.
std::vector<Eigen::Vector3d> readText(FileText text) {
  std::vector<Eigen::Vector3d> corners;
  bool ended = false;
  for (std::string_view word = text.word(); !word.empty(); word = text.word()) {
    ended = word == "endsolid";
    if (ended || word == "solid") text.line();  // its name
    if (word != "vertex") continue;
    for (double& x : corners.emplace_back()) x = text.number();
  }
  if (!ended) throw FileFault{"it is truncated"};
  return corners;
}

/// Reads facets of 50 bytes after a header: a normal, three corners and two more bytes.
std::vector<Eigen::Vector3d> readBinary(FileText facets) {
  const NumberType real = typeNamed("float");
  std::vector<Eigen::Vector3d> corners;
  facets.take(80);
  for (double left = facets.number(typeNamed("uint")); left > 0; --left) {
    facets.take(12);
    for (int i = 0; i < 3; ++i)
      for (double& x : corners.emplace_back()) x = facets.number(real);
    facets.take(2);
  }
  return corners;
}

}  // namespace

Polygons readStl(std::string_view content) {
  const bool text =
      content.starts_with("solid") && content.substr(0, 1024).find("facet") != content.npos;
  const std::vector<Eigen::Vector3d> corners =
      text ? readText(FileText(content)) : readBinary(FileText(content, Encoding::LittleEndian));
  Polygons polygons;
  const bool areGood = std::all_of(corners.begin(), corners.end(), [](const Eigen::Vector3d& p) {
    return p.cwiseAbs().maxCoeff() <= kLargestMeasure && p.allFinite();
  });
  // The checks of all formats refuse these positions.
  if (!areGood) {
    for (const Eigen::Vector3d& p : corners) polygons.addPosition(p);
    return polygons;
  }
  if (corners.size() >= kNoElement) throw FileFault{"it has too many vertices"};
  const Welded welded = weld(corners, {});
  for (const Eigen::Vector3d& p : welded.positions) polygons.addPosition(p);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    polygons.addCorner(welded.vertexOf[i]);
    if (i % 3 == 2) polygons.endCell(false);
  }
  if (polygons.hasOpenCell()) polygons.endCell(false);  // refuses it
  return polygons;
}

}  // namespace palpate::vtk
