#include "Vtk/MeshFile.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
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
  const auto bad = std::find_if_not(corners.begin(), corners.end(),
                                    [](const Eigen::Vector3d& p) { return p.allFinite(); });
  // The checks of all formats refuse these positions.
  if (bad != corners.end()) {
    for (const Eigen::Vector3d& p : corners) polygons.addPosition(p);
    return polygons;
  }
  // Equal corners become neighbours, the first one of the file in front.
  if (corners.size() > std::numeric_limits<std::uint32_t>::max())
    throw FileFault{"it has too many vertices"};
  std::vector<std::uint32_t> order(corners.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto isLess = [&](std::uint32_t i, std::uint32_t j) {
    const Eigen::Vector3d &p = corners[i], &q = corners[j];
    for (int k = 0; k < 3; ++k)
      if (p[k] != q[k]) return p[k] < q[k];
    return i < j;
  };
  std::sort(order.begin(), order.end(), isLess);
  std::vector<std::uint32_t> firstOf(corners.size()), vertexOf(corners.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool isNew = i == 0 || corners[order[i]] != corners[order[i - 1]];
    firstOf[order[i]] = isNew ? order[i] : firstOf[order[i - 1]];
  }
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (firstOf[i] == i) {
      vertexOf[i] = static_cast<std::uint32_t>(polygons.positionCount());
      polygons.addPosition(corners[i]);
    }
    polygons.addCorner(vertexOf[firstOf[i]]);
    if (i % 3 == 2) polygons.endCell(false);
  }
  if (polygons.hasOpenCell()) polygons.endCell(false);  // refuses it
  return polygons;
}

}  // namespace palpate::vtk
