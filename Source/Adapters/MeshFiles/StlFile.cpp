// Part of MeshFiles/Formats.h: STL files.

#include "MeshFiles/Formats.h"
#include "MeshFiles/Output.h"

#include <palpate/AnalyticalGeometry.h>

#include <Eigen/Geometry>

// Source: "StereoLithography Interface Specification", 3D Systems, 1988.

namespace palpate::files {

namespace {

constexpr std::size_t kHeader = 80, kFacet = 50;  // bytes of a binary file

bool isTextFile(std::string_view content) {
  if (!content.starts_with("solid") || content.substr(0, 1024).find("facet") == content.npos)
    return false;
  if (content.size() < kHeader + 4) return true;
  FileText binary = FileText(content).part(content.substr(kHeader));
  binary.setEncoding(Encoding::LittleEndian);
  const auto facets = static_cast<std::uint32_t>(binary.whole(4));
  return content.size() != kHeader + 4 + std::size_t{facets} * kFacet;
}

void addCorner(FileText& text, MeshBuilder& mesh) {
  Eigen::Vector3d position;
  const NumberType real = text.typeNamed("float");
  for (double& x : position) x = text.number(real);
  mesh.addPosition(position, text);
  mesh.addCorner(static_cast<double>(mesh.positionCount() - 1), text);
}

/// The words between "facet" and the next facet.
void readFacet(FileText& text, MeshBuilder& mesh) {
  text.expectWord("normal");
  for (int i = 0; i < 3; ++i) text.number();
  for (const char* word : {"outer", "loop"}) text.expectWord(word);
  for (int i = 0; i < 3; ++i) {
    text.expectWord("vertex");
    addCorner(text, mesh);
  }
  for (const char* word : {"endloop", "endfacet"}) text.expectWord(word);
  mesh.endCell(Cell::Polygon, text);
}

/// Solids of facets. A file that does not end with "endsolid" is truncated.
void readText(FileText text, MeshBuilder& mesh) {
  for (std::string_view word = text.word(); !word.empty(); word = text.word()) {
    if (word != "solid") text.refuseWord("solid", word);
    text.line();  // its name
    for (word = text.word(); word == "facet"; word = text.word()) readFacet(text, mesh);
    if (word != "endsolid") text.refuseWord("facet or endsolid", word);
    text.line();
  }
}

/// Facets: a normal, three corners and two more bytes.
void readBinary(FileText text, MeshBuilder& mesh) {
  text.setEncoding(Encoding::LittleEndian);
  text.take(kHeader);
  const auto facets = static_cast<std::uint32_t>(text.whole(4));
  text.checkCount(facets, "facets", kFacet);
  mesh.reservePositions(3 * std::size_t{facets});
  for (std::uint32_t i = 0; i < facets; ++i) {
    text.take(12);
    for (int corner = 0; corner < 3; ++corner) addCorner(text, mesh);
    text.take(2);
    mesh.endCell(Cell::Polygon, text);
  }
}

/// Zero for a triangle without area.
Eigen::Vector3d normalOf(const MeshArrays& mesh, const Triangle& triangle) {
  const auto [a, b, c] = triangle;
  const Eigen::Vector3d u = mesh.positions[b] - mesh.positions[a],
                        v = mesh.positions[c] - mesh.positions[a], normal = u.cross(v);
  const double length = normal.norm();
  if (!(length > 0 && length <= kLargestMeasure)) return Eigen::Vector3d::Zero();
  return normal / length;
}

}  // namespace

void readStl(FileText text, MeshBuilder& mesh) {
  if (isTextFile(text.rest()))
    readText(text, mesh);
  else
    readBinary(text, mesh);
}

std::string writeStl(const MeshArrays& mesh, const MeshWriteSettings& settings) {
  Output out(settings.binary ? Encoding::LittleEndian : Encoding::Text);
  const auto addPoint = [&](const Eigen::Vector3d& p) {
    if (settings.binary)
      out.numbers<float>(p);
    else
      out.numbers<double>(p).endLine();
  };
  std::string header = "Palpate";
  header.resize(kHeader, ' ');
  if (settings.binary)
    out.text(header).number(static_cast<std::uint32_t>(mesh.triangles.size()));
  else
    out.text("solid Palpate\n");
  for (const Triangle& triangle : mesh.triangles) {
    if (!settings.binary) out.text("facet normal ");
    addPoint(normalOf(mesh, triangle));
    if (!settings.binary) out.text("outer loop\n");
    for (const std::uint32_t vertex : triangle) {
      if (!settings.binary) out.text("vertex ");
      addPoint(mesh.positions[vertex]);
    }
    out.text(settings.binary ? std::string_view("\0\0", 2) : "endloop\nendfacet\n");
  }
  if (!settings.binary) out.text("endsolid Palpate\n");
  return out.take();
}

}  // namespace palpate::files
