#include "Vtk/FileText.h"
#include "Vtk/MeshFile.h"

#include <algorithm>
#include <cctype>
#include <map>

namespace palpate::vtk {

// Read here and not by VTK 9.1, whose reader reads past its arrays on a truncated file or a wrong
// polygon size. Source: "VTK File Formats", Kitware: the simple legacy formats, versions 1 to 5.1.

namespace {

NumberType typeNamed(std::string_view name) {
  static const std::map<std::string_view, NumberType> types{{"char", NumberType::Int8},
                                                            {"signed_char", NumberType::Int8},
                                                            {"unsigned_char", NumberType::UInt8},
                                                            {"short", NumberType::Int16},
                                                            {"unsigned_short", NumberType::UInt16},
                                                            {"int", NumberType::Int32},
                                                            {"unsigned_int", NumberType::UInt32},
                                                            {"long", NumberType::Int64},
                                                            {"unsigned_long", NumberType::UInt64},
                                                            {"vtktypeint64", NumberType::Int64},
                                                            {"vtktypeuint64", NumberType::UInt64},
                                                            {"vtkIdType", NumberType::Int32},
                                                            {"vtkidtype", NumberType::Int32},
                                                            {"float", NumberType::Float32},
                                                            {"double", NumberType::Float64}};
  const auto found = types.find(name);
  if (found == types.end())
    throw FileFault{"it names an unknown type \"" + std::string(name) + "\""};
  return found->second;
}

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
    m_encoding = encoding == "ASCII" ? Encoding::Ascii : Encoding::BigEndian;
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
      readPoints();
    } else if (keyword == "POLYGONS") {
      readCells([this](const std::vector<std::int64_t>& cell) { m_polygons.addPolygon(cell); });
    } else if (keyword == "TRIANGLE_STRIPS") {
      readCells([this](const std::vector<std::int64_t>& cell) { m_polygons.addStrip(cell); });
    } else if (keyword == "VERTICES" || keyword == "LINES") {
      readCells([](const std::vector<std::int64_t>&) {});
    } else if (keyword == "FIELD") {
      skipField();
    } else if (keyword == "METADATA") {
      m_text.line();
      while (!m_text.atEnd() && !m_text.line().empty()) {
      }
    } else {
      throw FileFault{"it has an unknown section \"" + keyword.substr(0, 40) + "\""};
    }
    return true;
  }

  /// Numbers follow; binary ones begin after the end of the line.
  NumberType beginNumbers(std::string_view typeName) {
    const NumberType type = typeNamed(typeName);
    m_text.line();
    return type;
  }

  void readPoints() {
    const std::size_t count = m_text.count();
    const NumberType type = beginNumbers(m_text.word());
    m_polygons.positions.resize(count);
    for (Eigen::Vector3d& position : m_polygons.positions) {
      for (double& coordinate : position) coordinate = m_text.number(type, m_encoding);
    }
  }

  template <class Add>
  void readCells(Add&& add) {
    const std::size_t first = m_text.count(), second = m_text.count();
    m_offsets ? readOffsetCells(first, second, add) : readSizedCells(first, second, add);
  }

  /// Up to version 4: each cell its number of corners, then these.
  template <class Add>
  void readSizedCells(std::size_t cells, std::size_t numbers, Add&& add) {
    m_text.line();
    for (std::size_t i = 0; i < cells; ++i) {
      const std::int64_t size = m_text.integer(NumberType::Int32, m_encoding);
      if (size < 0 || static_cast<std::uint64_t>(size) >= numbers) {
        throw FileFault{"cell " + std::to_string(i) + " (from 0) has a wrong number of corners"};
      }
      numbers -= static_cast<std::size_t>(size) + 1;
      std::vector<std::int64_t> cell;
      for (std::int64_t k = 0; k < size; ++k)
        cell.push_back(m_text.integer(NumberType::Int32, m_encoding));
      add(cell);
    }
    if (numbers != 0) throw FileFault{"its cells have fewer corners than it says"};
  }

  /// From version 5: where each cell begins, and one more; then all corners.
  template <class Add>
  void readOffsetCells(std::size_t offsetCount, std::size_t cornerCount, Add&& add) {
    const std::vector<std::int64_t> offsets = readArray("OFFSETS", offsetCount);
    const std::vector<std::int64_t> corners = readArray("CONNECTIVITY", cornerCount);
    for (std::size_t i = 0; i + 1 < offsets.size(); ++i) {
      if (offsets[i] < 0 || offsets[i + 1] < offsets[i] ||
          static_cast<std::uint64_t>(offsets[i + 1]) > cornerCount) {
        throw FileFault{"the offsets of its cells are not ascending or run past their corners"};
      }
      add(std::vector<std::int64_t>(corners.begin() + offsets[i],
                                    corners.begin() + offsets[i + 1]));
    }
  }

  std::vector<std::int64_t> readArray(std::string_view name, std::size_t count) {
    if (upperCase(m_text.word()) != name)
      throw FileFault{"it lacks the " + std::string(name) + " of its cells"};
    const NumberType type = beginNumbers(m_text.word());
    std::vector<std::int64_t> numbers(count);
    for (std::int64_t& number : numbers) number = m_text.integer(type, m_encoding);
    return numbers;
  }

  /// Arrays of data about the whole mesh.
  void skipField() {
    m_text.word();
    for (std::size_t arrays = m_text.count(); arrays > 0; --arrays) {
      m_text.word();
      const std::size_t components = m_text.count(), tuples = m_text.count();
      const std::string_view typeName = m_text.word();
      if (typeName == "string" || typeName == "bit")
        throw FileFault{"it has a field of " + std::string(typeName) + "s"};
      const NumberType type = beginNumbers(typeName);
      for (std::size_t i = 0; i < components * tuples; ++i) m_text.number(type, m_encoding);
    }
  }

  FileText m_text;
  Encoding m_encoding = Encoding::Ascii;
  bool m_offsets = false;
  Polygons m_polygons;
};

}  // namespace

Polygons readLegacyVtk(std::string_view content) { return Reader(content).read(); }

}  // namespace palpate::vtk
