// Part of MeshFiles/Formats.h: MEDIT files.

#include "MeshFiles/Formats.h"
#include "MeshFiles/Output.h"

#include <algorithm>

// Source: "MEDIT: an interactive mesh visualization software", Frey, INRIA RT-0253, 2001, appendix.

namespace palpate::files {

namespace {

struct Section {
  std::string_view name;
  Cell cell;
  int corners;
};
constexpr Section kElements[]{{"Edges", Cell::Polyline, 2},
                              {"Triangles", Cell::Polygon, 3},
                              {"Quadrilaterals", Cell::Polygon, 4},
                              {"Tetrahedra", Cell::Tetrahedron, 4}};

/// Sections that say more about vertices and elements of other sections, and the numbers of an
/// item.
struct Attribute {
  std::string_view name;
  std::size_t numbers;
};
constexpr Attribute kAttributes[]{{"Corners", 1},
                                  {"RequiredVertices", 1},
                                  {"Ridges", 1},
                                  {"RequiredEdges", 1},
                                  {"RequiredTriangles", 1},
                                  {"RequiredQuadrilaterals", 1},
                                  {"RequiredTetrahedra", 1},
                                  {"Normals", 3},
                                  {"Tangents", 3},
                                  {"NormalAtVertices", 2},
                                  {"TangentAtVertices", 2},
                                  {"NormalAtTriangleVertices", 3},
                                  {"NormalAtQuadrilateralVertices", 3},
                                  {"TangentAtEdges", 3}};

template <class Entries>
auto* named(const Entries& entries, std::string_view name) {
  const auto found = std::ranges::find_if(entries, [&](const auto& e) { return e.name == name; });
  return found == std::end(entries) ? nullptr : &*found;
}

class MeditReader {
 public:
  MeditReader(const FileText& text, MeshBuilder& mesh) : m_text(text), m_mesh(mesh) {}

  void read() {
    m_text.expectWord("MeshVersionFormatted");
    if (const std::int64_t version = m_text.whole(); version < 1 || version > 4)
      m_text.refuse("expected a MEDIT version from 1 to 4, not " + std::to_string(version));
    m_text.expectWord("Dimension");
    if (const std::int64_t dimension = m_text.whole(); dimension != 3)
      m_text.refuse("expected dimension 3, not " + std::to_string(dimension));
    std::string_view name = m_text.keyword();
    for (; name != "End"; name = m_text.keyword()) readSection(name);
  }

 private:
  void readSection(std::string_view name) {
    if (name == "Vertices") return readVertices();
    if (const Section* const section = named(kElements, name)) return readElements(*section);
    if (const Attribute* const attribute = named(kAttributes, name))
      return m_text.skip(m_text.typeNamed("double"),
                         attribute->numbers * m_text.count("items", 2 * attribute->numbers));
    if (name == "AngleOfCornerBound") return static_cast<void>(m_text.number());
    const FileText section = m_text;  // named by the fault
    if (m_text.word() != "0")
      section.refuseWord("Vertices, Edges, Triangles, Quadrilaterals, Tetrahedra or End", name);
  }

  void readVertices() {
    if (m_mesh.positionCount() > 0) m_text.refuse("expected one section Vertices, not two");
    const std::size_t count = m_text.count("vertices", 8);
    m_mesh.reservePositions(count);
    for (std::size_t i = 0; i < count; ++i) {
      Eigen::Vector3d position;
      for (double& x : position) x = m_text.number();
      m_mesh.addPosition(position, m_text);
      m_text.number();  // its reference
    }
  }

  void readElements(const Section& section) {
    const auto corners = static_cast<std::size_t>(section.corners);
    for (std::size_t left = m_text.count("elements", 2 * corners + 2); left > 0; --left) {
      for (std::size_t i = 0; i < corners; ++i)
        m_mesh.addCorner(static_cast<double>(m_text.whole()), m_text, 1);
      m_text.number();  // its reference
      m_mesh.endCell(section.cell, m_text);
    }
  }

  FileText m_text;
  MeshBuilder& m_mesh;
};

/// The content with blanks in place of comments, so that lines and bytes stay where they are.
std::string withoutComments(std::string_view content) {
  std::string text(content);
  for (std::size_t at = text.find('#'); at != text.npos; at = text.find('#', at))
    for (; at < text.size() && text[at] != '\n'; ++at) text[at] = ' ';
  return text;
}

}  // namespace

void readMedit(FileText text, MeshBuilder& mesh) {
  const std::string content = withoutComments(text.rest());
  MeditReader(FileText(content), mesh).read();
}

std::string writeMedit(const MeshArrays& mesh, const MeshWriteSettings&) {
  Output out(Encoding::Text);
  const auto addElements = [&](std::string_view name, const auto& elements) {
    if (elements.empty()) return;
    out.text(name).text("\n").decimal(elements.size()).text("\n");
    for (const auto& element : elements) {
      for (const std::uint32_t vertex : element) out.number(vertex + std::uint64_t{1});
      out.text("0\n");
    }
  };
  out.text("MeshVersionFormatted 2\nDimension 3\nVertices\n").decimal(mesh.positions.size());
  out.text("\n");
  for (const Eigen::Vector3d& p : mesh.positions) out.numbers<double>(p).text("0\n");
  addElements("Edges", mesh.segments);
  addElements("Triangles", mesh.triangles);
  addElements("Tetrahedra", mesh.tetrahedra);
  return out.text("End\n").take();
}

}  // namespace palpate::files
