// Part of MeshFiles/Formats.h: legacy VTK files.

#include "MeshFiles/Formats.h"
#include "MeshFiles/Output.h"
#include "MeshFiles/VtkCells.h"

#include <algorithm>
#include <cctype>
#include <optional>

// Source: "VTK File Formats", Kitware: the simple legacy formats, versions 1 to 5.1.

namespace palpate::files {

namespace {

struct CellSection {
  std::string_view name;
  Cell kind;
};
constexpr CellSection kCells[]{{"VERTICES", Cell::Points},
                               {"LINES", Cell::Polyline},
                               {"POLYGONS", Cell::Polygon},
                               {"TRIANGLE_STRIPS", Cell::Strip}};

class LegacyVtkReader {
 public:
  LegacyVtkReader(const FileText& text, MeshBuilder& mesh) : m_text(text), m_mesh(mesh) {}

  void read() {
    readHeader();
    // The mesh ends where POINT_DATA or CELL_DATA begins.
    for (std::string section = keyword(); !section.empty() && !section.ends_with("_DATA");
         section = keyword())
      readSection(section);
    if (m_cells && !m_cells->types) m_text.refuseWord("CELL_TYPES", "");
    if (m_cells) readCells(*m_cells, m_mesh);
  }

 private:
  void readHeader() {
    constexpr std::string_view kStart = "# vtk DataFile Version ";
    const std::string_view first = m_text.line();
    if (!first.starts_with(kStart)) m_text.refuseWord(kStart, first);
    m_hasEnds = m_text.part(first.substr(kStart.size())).number() >= 5;
    m_text.line();  // the title
    const std::string encoding = keyword();
    if (encoding != "ASCII" && encoding != "BINARY") m_text.refuseWord("ASCII or BINARY", encoding);
    if (encoding == "BINARY") m_encoding = Encoding::BigEndian;
    if (keyword() != "DATASET") m_text.refuse("expected DATASET");
    const std::string set = keyword();
    m_isGrid = set == "UNSTRUCTURED_GRID";
    if (!m_isGrid && set != "POLYDATA") m_text.refuseWord("POLYDATA or UNSTRUCTURED_GRID", set);
  }

  std::string keyword() {
    std::string text(m_text.word());
    for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return text;
  }

  void readSection(const std::string& section) {
    if (section == "POINTS") return readPoints();
    if (section == "FIELD") return skipFields();
    if (section == "METADATA") {  // ends with an empty line
      for (m_text.line(); !m_text.line().empty();) {
      }
      return;
    }
    if (m_isGrid && section == "CELLS") return startGrid();
    if (m_isGrid && section == "CELL_TYPES") return startTypes();
    for (const CellSection& cells : kCells) {
      if (m_isGrid || section != cells.name) continue;
      VtkCells found = takeCells();
      found.kind = cells.kind;
      return readCells(found, m_mesh);
    }
    m_text.refuseWord("a section of the data set", section);
  }

  void readPoints() {
    if (m_mesh.positionCount() > 0) m_text.refuse("expected one section POINTS, not two");
    const std::size_t count = m_text.count("points", 3);
    NumberArray array = startArray();
    m_mesh.readPositions(array.text, array.type, count);
    continueAfter(array);
  }

  /// Arrays of data about the whole mesh.
  void skipFields() {
    m_text.keyword();
    for (std::size_t arrays = m_text.count("arrays", 8); arrays > 0; --arrays) {
      m_text.keyword();
      const std::size_t components = m_text.count("components", 1),
                        tuples = m_text.count("tuples", std::max<std::size_t>(components, 1));
      takeArray(components * tuples);
    }
  }

  void startGrid() {
    if (m_cells) m_text.refuse("expected one section CELLS, not two");
    m_cells = takeCells();
  }

  void startTypes() {
    const std::size_t count = m_text.count("types", 2);
    if (!m_cells) m_text.refuse("expected CELLS before CELL_TYPES");
    if (count != m_cells->count)
      m_text.refuse("expected the types of " + std::to_string(m_cells->count) + " cells, not " +
                    std::to_string(count));
    m_text.line();
    m_cells->types = takeNumbers(m_text.typeNamed("int"), count);
  }

  /// Reads the name of a type. Binary numbers begin in the next line.
  NumberArray startArray() {
    const NumberType type = m_text.typeNamed(m_text.word());
    m_text.line();
    return startNumbers(type);
  }
  NumberArray startNumbers(const NumberType& type) {
    NumberArray array{m_text, type};
    array.text.setEncoding(m_encoding);
    return array;
  }
  void continueAfter(const NumberArray& array) {
    m_text = array.text;
    m_text.setEncoding(Encoding::Text);
  }

  /// Goes on after the numbers, which are read later.
  NumberArray takeNumbers(const NumberType& type, std::size_t count) {
    NumberArray array = startNumbers(type), after = array;
    after.text.skip(type, count);
    continueAfter(after);
    const std::string_view rest = array.text.rest();
    return {array.text.part(rest.substr(0, rest.size() - after.text.left())), type};
  }
  NumberArray takeArray(std::size_t count) {
    const NumberType type = startArray().type;
    return takeNumbers(type, count);
  }
  NumberArray takeNamed(const char* name, std::size_t count) {
    if (keyword() != name) m_text.refuse(std::string("expected ") + name);
    return takeArray(count);
  }

  VtkCells takeCells() {
    const std::size_t first = m_text.count("cells", 1), second = m_text.count("corners", 1);
    if (m_hasEnds) {  // the start of each cell and the end of the last; then all corners
      NumberArray ends = takeNamed("OFFSETS", first);
      if (first > 0 && ends.next() != 0) ends.text.refuse("expected a first offset of 0");
      NumberArray corners = takeNamed("CONNECTIVITY", second);
      return {first > 0 ? first - 1 : 0, corners, ends, {}};
    }
    m_text.line();
    return {first, takeNumbers(m_text.typeNamed("int"), second), {}, {}};
  }

  FileText m_text;
  MeshBuilder& m_mesh;
  Encoding m_encoding = Encoding::Text;
  bool m_hasEnds = false;  ///< cells are stored by offsets, as from version 5 on
  bool m_isGrid = false;
  std::optional<VtkCells> m_cells;  ///< of a grid, until their types are known
};

}  // namespace

void readLegacyVtk(FileText text, MeshBuilder& mesh) { LegacyVtkReader(text, mesh).read(); }

std::string writeLegacyVtk(const MeshArrays& mesh, const MeshWriteSettings& settings) {
  Output out(settings.binary ? Encoding::BigEndian : Encoding::Text);
  const bool isGrid = !mesh.tetrahedra.empty();
  const auto addCells = [&](const auto& elements) {
    for (const auto& element : elements)
      out.number(static_cast<std::int32_t>(element.size()))
          .template numbers<std::int32_t>(element)
          .endLine();
  };
  const auto head = [&](std::string_view name, std::size_t count, std::size_t size) {
    out.text(name).text(" ").decimal(count).text(" ").decimal(size).text("\n");
  };
  const auto end = [&] { out.text(settings.binary ? "\n" : ""); };
  out.text("# vtk DataFile Version 3.0\nPalpate\n").text(settings.binary ? "BINARY" : "ASCII");
  out.text("\nDATASET ").text(isGrid ? "UNSTRUCTURED_GRID" : "POLYDATA").text("\nPOINTS ");
  out.decimal(mesh.positions.size()).text(" double\n");
  for (const Eigen::Vector3d& p : mesh.positions) out.numbers<double>(p).endLine();
  end();
  if (!isGrid) {
    std::size_t section = 0;
    forVtkKinds(mesh, [&](VtkType, const auto& elements) {
      const std::string_view name = section < 3 ? kCells[section++].name : "";
      if (elements.empty()) return;
      head(name, elements.size(), elements.size() * (1 + elements[0].size()));
      addCells(elements);
      end();
    });
    return out.take();
  }
  std::size_t count = 0, size = 0;
  forVtkKinds(mesh, [&](VtkType, const auto& elements) {
    count += elements.size();
    for (const auto& element : elements) size += 1 + element.size();
  });
  head("CELLS", count, size);
  forVtkKinds(mesh, [&](VtkType, const auto& elements) { addCells(elements); });
  end();
  out.text("CELL_TYPES ").decimal(count).text("\n");
  forVtkKinds(mesh, [&](VtkType type, const auto& elements) {
    for (std::size_t i = 0; i < elements.size(); ++i)
      out.number(static_cast<std::int32_t>(type)).endLine();
  });
  end();
  return out.take();
}

}  // namespace palpate::files
