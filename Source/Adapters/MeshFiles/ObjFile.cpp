// Part of MeshFiles/Formats.h: OBJ files.

#include "MeshFiles/Formats.h"
#include "MeshFiles/Output.h"

#include <algorithm>
#include <array>

// Source: "Object Files (.obj)", Wavefront, appendix B1. Only the elements of polygonal geometry.

namespace palpate::files {

namespace {

/// Statements that say nothing about positions and elements.
constexpr std::string_view kIgnoredKeywords[]{
    "",      "g",        "s",        "mg",     "o",          "vt",
    "vn",    "vp",       "usemtl",   "mtllib", "usemap",     "maplib",
    "bevel", "c_interp", "d_interp", "lod",    "shadow_obj", "trace_obj"};

/// Reads the vertex of "7", "7/1", "7//2" or "7/1/2". Positive indices begin at 1; negative indices
/// count back from the newest vertex.
void addCorner(std::string_view corner, const FileText& statement, MeshBuilder& mesh) {
  const std::string_view digits = corner.substr(0, corner.find('/'));
  const auto index = static_cast<double>(statement.part(digits).whole());
  const auto newest = static_cast<double>(mesh.positionCount());
  if (index < 0 && -index > newest)
    statement.refuse("expected an index that counts back over at most the " + shortest(newest) +
                     " vertices before it, not " + shortest(index));
  mesh.addCorner(index < 0 ? newest + index + 1 : index, statement, 1);
}

void readCell(FileText& statement, MeshBuilder& mesh, Cell cell) {
  for (std::string_view corner = statement.word(); !corner.empty(); corner = statement.word())
    addCorner(corner, statement, mesh);
  mesh.endCell(cell, statement);
}

void readStatement(FileText statement, MeshBuilder& mesh) {
  const std::string_view keyword = statement.word();
  if (keyword == "v") {
    Eigen::Vector3d position;
    for (double& x : position) x = statement.number();
    mesh.addPosition(position, statement);
  } else if (keyword == "f") {
    readCell(statement, mesh, Cell::Polygon);
  } else if (keyword == "l") {
    readCell(statement, mesh, Cell::Polyline);
  } else if (keyword == "p") {
    readCell(statement, mesh, Cell::Points);
  } else if (std::ranges::find(kIgnoredKeywords, keyword) == std::end(kIgnoredKeywords)) {
    statement.refuseWord("a statement v, p, l or f, or an attribute", keyword);
  }
}

std::string_view withoutComment(std::string_view line) { return line.substr(0, line.find('#')); }

}  // namespace

void readObj(FileText text, MeshBuilder& mesh) {
  while (text.left() > 0) {
    const std::string_view first = text.line();
    if (!first.ends_with('\\')) {
      readStatement(text.part(withoutComment(first)), mesh);
      continue;
    }
    std::string statement(first);  // goes on in the next line
    while (statement.ends_with('\\') && text.left() > 0)
      statement.replace(statement.size() - 1, 1, " ").append(text.line());
    readStatement(text.decoded(withoutComment(statement), Encoding::Text, first.data()), mesh);
  }
}

std::string writeObj(const MeshArrays& mesh, const MeshWriteSettings&) {
  Output out(Encoding::Text);
  for (const Eigen::Vector3d& p : mesh.positions) out.text("v ").numbers<double>(p).endLine();
  const auto addCell = [&](std::string_view keyword, const auto& cell) {
    out.text(keyword);
    for (const std::uint32_t vertex : cell) out.number(vertex + std::uint64_t{1});
    out.endLine();
  };
  for (const std::uint32_t point : mesh.points) addCell("p ", std::array{point});
  for (const Segment& segment : mesh.segments) addCell("l ", segment);
  for (const Triangle& triangle : mesh.triangles) addCell("f ", triangle);
  return out.take();
}

}  // namespace palpate::files
