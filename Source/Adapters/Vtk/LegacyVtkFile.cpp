#include "Vtk/MeshFile.h"

#include <cctype>
#include <cmath>

namespace palpate::vtk {

// These files are not read by VTK 9.1: its reader crashes on truncated files and wrong polygon
// sizes, or returns a part of the mesh. Source: "VTK File Formats", Kitware: the simple legacy
// formats, versions 1 to 5.1.

namespace {

class Reader {
 public:
  explicit Reader(std::string_view content) : m_text(content) {}

  Polygons read() {
    const std::string_view first = m_text.line();
    constexpr std::string_view kStart = "# vtk DataFile Version ";
    if (!first.starts_with(kStart)) throw FileFault{"it does not begin as a VTK file"};
    m_offsets = FileText(first.substr(kStart.size())).number() >= 5;
    m_text.line();  // the title
    const std::string encoding = keyword();
    if (encoding == "BINARY") m_text.setEncoding(Encoding::BigEndian);
    if (encoding != "ASCII" && encoding != "BINARY")
      throw FileFault{"its third line is neither ASCII nor BINARY"};
    // The mesh ends where POINT_DATA or CELL_DATA begins.
    for (std::string section = keyword(); !section.empty() && !section.ends_with("_DATA");
         section = keyword())
      readSection(section);
    return std::move(m_polygons);
  }

 private:
  std::string keyword() {
    std::string text(m_text.word());
    for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return text;
  }

  void readSection(const std::string& section) {
    if (section == "DATASET") {
      const std::string dataSet = keyword();
      if (dataSet != "POLYDATA")
        throw FileFault{"its data set is " + dataSet.substr(0, 40) + ", not POLYDATA"};
    } else if (section == "POINTS") {
      const std::size_t count = m_text.count();
      m_polygons.clearPositions();
      m_polygons.addPositions(readArray(3 * count));
    } else if (section == "POLYGONS" || section == "TRIANGLE_STRIPS") {
      readCells(&m_polygons, section == "TRIANGLE_STRIPS");
    } else if (section == "VERTICES" || section == "LINES") {
      readCells(nullptr, false);
    } else if (section == "FIELD") {  // arrays of data about the whole mesh
      m_text.word();
      for (std::size_t arrays = m_text.count(); arrays > 0; --arrays) {
        m_text.word();
        const std::size_t components = m_text.count();
        readArray(components * m_text.count());
      }
    } else if (section == "METADATA") {
      for (m_text.line(); !m_text.line().empty();) {
      }
    } else {
      throw FileFault{"it has an unknown section \"" + section.substr(0, 40) + "\""};
    }
  }

  /// Reads the name of a type, and numbers of that type. Binary numbers begin on the next line.
  std::vector<double> readArray(std::size_t count) {
    const NumberType type = typeNamed(m_text.word());
    m_text.line();
    return m_text.numbers(type, count);
  }

  /// Without polygons, the cells are skipped.
  void readCells(Polygons* polygons, bool strips) {
    const std::size_t first = m_text.count(), second = m_text.count();
    if (m_offsets) {  // the start of each cell and the end of the last; then all corners
      const std::vector<double> offsets = readNamed("OFFSETS", first);
      const std::vector<double> corners = readNamed("CONNECTIVITY", second);
      if (polygons) polygons->addCells(offsets, corners, strips);
      return;
    }
    m_text.line();
    const NumberType type = typeNamed("int");
    std::size_t left = second;
    for (std::size_t i = 0; i < first; ++i) {  // its number of corners, then these
      const double length = left > 0 ? m_text.number(type) : -1;
      if (length < 0 || length >= static_cast<double>(left) || length != std::floor(length))
        throw FileFault{"cell " + std::to_string(i) + " (from 0) has a wrong number of corners"};
      const auto corners = static_cast<std::size_t>(length);
      for (std::size_t k = 0; k < corners; ++k) {
        const double corner = m_text.number(type);
        if (polygons) polygons->addCorner(corner);
      }
      left -= 1 + corners;
      if (polygons) polygons->endCell(strips);
    }
    if (left > 0) throw FileFault{"its cells have fewer corners than their count"};
  }

  std::vector<double> readNamed(const std::string& name, std::size_t count) {
    if (keyword() != name) throw FileFault{"it has no " + name + " for its cells"};
    return readArray(count);
  }

  FileText m_text;
  bool m_offsets = false;  ///< cells are stored by offsets, as from version 5 on
  Polygons m_polygons;
};

}  // namespace

Polygons readLegacyVtk(std::string_view content) { return Reader(content).read(); }

}  // namespace palpate::vtk
