#include "Vtk/FileText.h"
#include "Vtk/MeshFile.h"

#include <algorithm>
#include <cctype>

namespace palpate::vtk {

// Read here and not by VTK 9.1, whose reader crashes on truncated files and wrong polygon sizes, or
// gives a part of the mesh. Source: "VTK File Formats", Kitware: the simple legacy formats,
// versions 1 to 5.1.

namespace {

std::string upperCase(std::string_view word) {
  std::string text(word);
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return std::toupper(c); });
  return text;
}

class Reader {
 public:
  explicit Reader(std::string_view content) : m_text(content) {}

  Polygons read() {
    const std::string_view first = m_text.line();
    constexpr std::string_view kStart = "# vtk DataFile Version ";
    if (!first.starts_with(kStart)) throw FileFault{"it does not begin as a VTK file"};
    m_offsets = toNumber(FileText(first.substr(kStart.size())).word()) >= 5;
    m_text.line();  // the title
    const std::string encoding = upperCase(m_text.word());
    if (encoding != "ASCII" && encoding != "BINARY")
      throw FileFault{"it says neither ASCII nor BINARY"};
    if (encoding == "BINARY") m_text.setEncoding(Encoding::BigEndian);
    while (readSection()) {
    }
    return std::move(m_polygons);
  }

 private:
  /// False at the end of what makes the mesh.
  bool readSection() {
    const std::string keyword = upperCase(m_text.word());
    if (keyword.empty() || keyword == "POINT_DATA" || keyword == "CELL_DATA") return false;
    if (keyword == "DATASET") {
      const std::string kind = upperCase(m_text.word());
      if (kind != "POLYDATA") throw FileFault{"its data set is " + kind + ", not POLYDATA"};
    } else if (keyword == "POINTS") {
      const std::size_t count = m_text.count(m_text.left());
      m_polygons.positions.clear();
      m_polygons.addPositions(readArray(m_text.word(), 3 * count));
    } else if (keyword == "POLYGONS" || keyword == "TRIANGLE_STRIPS") {
      readCells(m_polygons, keyword == "TRIANGLE_STRIPS");
    } else if (keyword == "VERTICES" || keyword == "LINES") {
      Polygons ignored;
      readCells(ignored, false);
    } else if (keyword == "FIELD") {
      skipField();
    } else if (keyword == "METADATA") {
      m_text.line();
      while (!m_text.line().empty()) {
      }
    } else {
      throw FileFault{"it has an unknown section \"" + keyword.substr(0, 40) + "\""};
    }
    return true;
  }

  /// Binary numbers begin after the end of the line.
  std::vector<double> readArray(std::string_view type, std::size_t count) {
    m_text.line();
    return m_text.numbers(typeNamed(type), count);
  }

  void readCells(Polygons& polygons, bool strips) {
    const std::size_t first = m_text.count(m_text.left()), second = m_text.count(m_text.left());
    m_offsets ? readOffsetCells(first, second, polygons, strips)
              : readSizedCells(first, second, polygons, strips);
  }

  /// Up to version 4: each cell its number of corners, then these.
  void readSizedCells(std::size_t cells, std::size_t count, Polygons& polygons, bool strips) {
    const std::vector<double> numbers = readArray("int", count);
    std::size_t at = 0;
    for (std::size_t i = 0; i < cells; ++i) {
      if (at == count || !isCount(numbers[at], count - at - 1))
        throw FileFault{"cell " + std::to_string(i) + " (from 0) has a wrong number of corners"};
      const double begin = static_cast<double>(at + 1), end = begin + numbers[at];
      polygons.addCells({begin, end}, numbers, strips);
      at = static_cast<std::size_t>(end);
    }
    if (at != count) throw FileFault{"its cells have fewer corners than it says"};
  }

  /// From version 5: where each cell begins, and one more; then all corners.
  void readOffsetCells(std::size_t offsetCount, std::size_t cornerCount, Polygons& polygons,
                       bool strips) {
    const std::vector<double> offsets = readNamed("OFFSETS", offsetCount);
    polygons.addCells(offsets, readNamed("CONNECTIVITY", cornerCount), strips);
  }

  std::vector<double> readNamed(const std::string& name, std::size_t count) {
    if (upperCase(m_text.word()) != name) throw FileFault{"it lacks the " + name + " of its cells"};
    return readArray(m_text.word(), count);
  }

  /// Arrays of data about the whole mesh.
  void skipField() {
    m_text.word();
    for (std::size_t arrays = m_text.count(m_text.left()); arrays > 0; --arrays) {
      m_text.word();
      const std::size_t components = m_text.count(m_text.left());
      const std::size_t tuples = m_text.count(m_text.left());
      readArray(m_text.word(), components * tuples);
    }
  }

  FileText m_text;
  bool m_offsets = false;
  Polygons m_polygons;
};

}  // namespace

Polygons readLegacyVtk(std::string_view content) { return Reader(content).read(); }

}  // namespace palpate::vtk
