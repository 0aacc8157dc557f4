#include "Vtk/FileText.h"
#include "Vtk/MeshFile.h"

#include <vtkCallbackCommand.h>
#include <vtkDataCompressor.h>
#include <vtkExecutive.h>
#include <vtkLZ4DataCompressor.h>
#include <vtkLZMADataCompressor.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkSTLReader.h>
#include <vtkSmartPointer.h>
#include <vtkXMLDataElement.h>
#include <vtkXMLDataParser.h>
#include <vtkZLibDataCompressor.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <sstream>

namespace palpate::vtk {

namespace {

/// Takes what a reader would print. VTK's global output window stays as it is.
class Complaints {
 public:
  Complaints() {
    m_command->SetClientData(this);
    m_command->SetCallback([](vtkObject*, unsigned long event, void* complaints, void* text) {
      if (event == vtkCommand::ErrorEvent) {
        static_cast<Complaints*>(complaints)->take(text ? static_cast<const char*>(text) : "");
      }
    });
  }
  void watch(vtkObject* object) {
    object->AddObserver(vtkCommand::ErrorEvent, m_command);
    object->AddObserver(vtkCommand::WarningEvent, m_command);
  }
  void throwIfAny() const {
    if (m_any) throw FileFault{m_first.empty() ? "VTK cannot read it" : m_first};
  }

 private:
  /// Of "ERROR: In file, line n\nvtkReader (0x...): the reason\n\n" the reason.
  void take(std::string text) {
    if (m_any) return;
    m_any = true;
    if (const std::size_t start = text.find("): "); start != text.npos) text.erase(0, start + 3);
    m_first = text.substr(0, text.find('\n'));
    while (m_first.ends_with('.') || m_first.ends_with(' ')) m_first.pop_back();
  }

  vtkNew<vtkCallbackCommand> m_command;
  std::string m_first;
  bool m_any = false;
};

/// A binary STL file says how many facets of 50 bytes it has; VTK does not look.
void checkBinaryStlLength(std::string_view content) {
  constexpr std::size_t kHeader = 80, kFacet = 50;
  const bool text =
      content.starts_with("solid") && content.substr(0, 1024).find("facet") != content.npos;
  if (text || content.size() < kHeader + 4) return;
  FileText facetList(content.substr(kHeader));
  const auto facets = facetList.integer(NumberType::UInt32, Encoding::LittleEndian);
  if (facetList.left() / kFacet < static_cast<std::uint64_t>(facets))
    throw FileFault{"it ends too early"};
}

/// Vertices at equal positions become the first of them.
void mergeVertices(Polygons& polygons) {
  const std::vector<Eigen::Vector3d> all = std::move(polygons.positions);
  std::vector<std::size_t> order(all.size());
  std::iota(order.begin(), order.end(), 0);
  const auto before = [&](std::size_t l, std::size_t r) {
    return std::lexicographical_compare(all[l].begin(), all[l].end(), all[r].begin(), all[r].end());
  };
  std::stable_sort(order.begin(), order.end(), before);
  std::vector<std::size_t> first(all.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && !before(order[i - 1], order[i]);
    first[order[i]] = same ? first[order[i - 1]] : order[i];
  }
  std::vector<std::int64_t> merged(all.size());
  polygons.positions.clear();
  for (std::size_t v = 0; v < all.size(); ++v) {
    if (first[v] == v) {
      merged[v] = static_cast<std::int64_t>(polygons.positions.size());
      polygons.positions.push_back(all[v]);
    } else {
      merged[v] = merged[first[v]];
    }
  }
  for (std::int64_t& corner : polygons.corners) corner = merged[static_cast<std::size_t>(corner)];
}

/// The arrays of a VTP file, whose XML VTK parses and whose blocks VTK uncompresses. VTK's own
/// reader of it prints past its observers, and allocates and copies what a damaged file's sizes
/// say.
class VtpReader {
 public:
  explicit VtpReader(std::string_view content) : m_content(content) {
    m_complaints.watch(m_parser);
    // Appended data need not be XML.
    const std::size_t appended = content.find("<AppendedData");
    std::istringstream xml(std::string(content.substr(0, appended)) +
                           (appended == content.npos ? "" : "</VTKFile>"));
    m_parser->SetStream(&xml);
    const int parsed = m_parser->Parse();
    m_parser->SetStream(nullptr);
    m_complaints.throwIfAny();
    m_root = m_parser->GetRootElement();
    if (parsed == 0 || m_root == nullptr) throw FileFault{"it is no XML file"};
    m_encoding = attribute(m_root, "byte_order") == "BigEndian" ? Encoding::BigEndian
                                                                : Encoding::LittleEndian;
    m_headerType =
        attribute(m_root, "header_type") == "UInt64" ? NumberType::UInt64 : NumberType::UInt32;
    makeCompressor(attribute(m_root, "compressor"));
    if (appended != content.npos) takeAppendedData(content.substr(appended));
  }

  Polygons read() {
    vtkXMLDataElement* data = m_root->FindNestedElementWithName("PolyData");
    if (data == nullptr) throw FileFault{"it holds no PolyData"};
    for (int i = 0; i < data->GetNumberOfNestedElements(); ++i) {
      vtkXMLDataElement* piece = data->GetNestedElement(i);
      if (std::string_view(piece->GetName()) == "Piece") readPiece(piece);
    }
    return std::move(m_polygons);
  }

 private:
  static std::string attribute(vtkXMLDataElement* element, const char* name) {
    const char* value = element->GetAttribute(name);
    return value == nullptr ? "" : value;
  }

  void makeCompressor(const std::string& name) {
    if (name.empty()) return;
    if (name == "vtkZLibDataCompressor")
      m_compressor = vtkSmartPointer<vtkZLibDataCompressor>::New();
    if (name == "vtkLZ4DataCompressor") m_compressor = vtkSmartPointer<vtkLZ4DataCompressor>::New();
    if (name == "vtkLZMADataCompressor")
      m_compressor = vtkSmartPointer<vtkLZMADataCompressor>::New();
    if (m_compressor == nullptr) throw FileFault{"it is compressed in an unknown way"};
    m_complaints.watch(m_compressor);
  }

  /// What follows "_" in the element.
  void takeAppendedData(std::string_view element) {
    const std::size_t tag = element.find('>'), start = element.find('_', tag);
    if (tag == element.npos || start == element.npos) throw FileFault{"it ends too early"};
    m_appendedRaw = element.substr(0, tag).find("\"raw\"") != element.npos;
    m_appended = element.substr(start + 1);
  }

  /// At most what a file of this length can hold: compression makes a number a thousandth of a
  /// byte, hardly less.
  std::size_t count(vtkXMLDataElement* piece, const char* name) const {
    const std::string text = attribute(piece, name);
    const double value = text.empty() ? 0.0 : toNumber(text);
    if (!(value >= 0) || value > 1e3 * static_cast<double>(m_content.size())) {
      throw FileFault{"it is shorter than its own counts say"};
    }
    return static_cast<std::size_t>(value);
  }

  void readPiece(vtkXMLDataElement* piece) {
    const auto first = static_cast<std::int64_t>(m_polygons.positions.size());
    const std::size_t points = count(piece, "NumberOfPoints");
    if (points > 0) {
      const std::vector<double> numbers = readArray(arrayOf(piece, "Points", ""), 3 * points);
      for (std::size_t i = 0; i < points; ++i) {
        m_polygons.positions.emplace_back(numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]);
      }
    }
    readCells(piece, "Polys", "NumberOfPolys", first,
              [this](const std::vector<std::int64_t>& cell) { m_polygons.addPolygon(cell); });
    readCells(piece, "Strips", "NumberOfStrips", first,
              [this](const std::vector<std::int64_t>& cell) { m_polygons.addStrip(cell); });
  }

  /// The array of that name in a group of the piece; the first one if the name is empty.
  static vtkXMLDataElement* arrayOf(vtkXMLDataElement* piece, const char* group,
                                    std::string_view name) {
    if (vtkXMLDataElement* parent = piece->FindNestedElementWithName(group)) {
      for (int i = 0; i < parent->GetNumberOfNestedElements(); ++i) {
        vtkXMLDataElement* array = parent->GetNestedElement(i);
        if (name.empty() || attribute(array, "Name") == name) return array;
      }
    }
    throw FileFault{"it lacks an array of its " + std::string(group)};
  }

  template <class Add>
  void readCells(vtkXMLDataElement* piece, const char* group, const char* countName,
                 std::int64_t first, Add&& add) {
    const std::size_t cells = count(piece, countName);
    if (cells == 0) return;
    const std::vector<double> ends = readArray(arrayOf(piece, group, "offsets"), cells);
    for (std::size_t i = 0; i < cells; ++i) {
      const bool ascending = ends[i] >= (i == 0 ? 0.0 : ends[i - 1]);  // false for NaN
      if (!ascending || ends[i] > 1e3 * static_cast<double>(m_content.size())) {
        throw FileFault{"the offsets of its cells are not ascending or run past their corners"};
      }
    }
    const auto corners =
        readArray(arrayOf(piece, group, "connectivity"), static_cast<std::size_t>(ends.back()));
    std::size_t begin = 0;
    for (const double end : ends) {
      std::vector<std::int64_t> cell;
      for (; begin < static_cast<std::size_t>(end); ++begin) {
        cell.push_back(std::abs(corners[begin]) < 0x1p53
                           ? first + static_cast<std::int64_t>(corners[begin])
                           : -1);
      }
      add(cell);
    }
  }

  std::vector<double> readArray(vtkXMLDataElement* array, std::size_t size) {
    const NumberType type = typeNamed(attribute(array, "type"));
    const std::string format = attribute(array, "format");
    std::string data;
    Encoding encoding = m_encoding;
    if (format == "appended") {
      const double offset = toNumber(attribute(array, "offset"));
      if (!(offset >= 0) || offset > static_cast<double>(m_appended.size()))
        throw FileFault{"it ends too early"};
      const std::string_view start = m_appended.substr(static_cast<std::size_t>(offset));
      data =
          uncompressed(m_appendedRaw ? std::string(start) : fromBase64(start), size * sizeOf(type));
    } else if (format == "binary") {
      data = uncompressed(fromBase64(textOf(array)), size * sizeOf(type));
    } else {
      data = textOf(array);
      encoding = Encoding::Ascii;
    }
    FileText text(data);
    std::vector<double> numbers;
    for (std::size_t i = 0; i < size; ++i) numbers.push_back(text.number(type, encoding));
    return numbers;
  }

  /// What stands between an element's start and the next tag.
  std::string_view textOf(vtkXMLDataElement* element) const {
    const auto start =
        static_cast<std::size_t>(std::max<vtkTypeInt64>(0, element->GetXMLByteIndex()));
    const std::string_view rest = m_content.substr(std::min(start, m_content.size()));
    const std::size_t tag = rest.find('>');
    if (tag == rest.npos) throw FileFault{"it ends too early"};
    return rest.substr(tag + 1, rest.find('<', tag) - tag - 1);
  }

  static NumberType typeNamed(const std::string& name) {
    constexpr std::array<std::string_view, 10> kNames{"Int8",    "UInt8",  "Int16", "UInt16",
                                                      "Int32",   "UInt32", "Int64", "UInt64",
                                                      "Float32", "Float64"};
    const auto found = std::find(kNames.begin(), kNames.end(), name);
    if (found == kNames.end()) throw FileFault{"one of its arrays has an unknown type of number"};
    return static_cast<NumberType>(found - kNames.begin());
  }

  /// A block's bytes behind its header: its length; or the number of compressed blocks, their
  /// length and the last one's (0: as the others) before compression, and the lengths after it.
  std::string uncompressed(std::string_view block, std::size_t expected) {
    FileText text(block);
    const auto length = [&] {
      return static_cast<std::size_t>(text.integer(m_headerType, m_encoding));
    };
    if (m_compressor == nullptr) {
      const std::size_t size = length();
      return std::string(text.take(size));
    }
    const std::size_t blocks = length(), whole = length(), last = length();
    if (blocks > text.left()) throw FileFault{"it ends too early"};
    std::vector<std::size_t> lengths(blocks);
    for (std::size_t& one : lengths) one = length();
    std::string result;
    for (std::size_t i = 0; i < blocks; ++i) {
      const std::size_t size = i + 1 == blocks && last > 0 ? last : whole;
      const std::string_view compressed = text.take(lengths[i]);
      // All that is expected and nothing more.
      if (size > expected - result.size())
        throw FileFault{"one of its compressed blocks has a wrong size"};
      const std::size_t start = result.size();
      result.resize(start + size);
      const std::size_t got = m_compressor->Uncompress(
          reinterpret_cast<const unsigned char*>(compressed.data()), compressed.size(),
          reinterpret_cast<unsigned char*>(result.data() + start), size);
      m_complaints.throwIfAny();
      if (got != size) throw FileFault{"one of its compressed blocks is damaged"};
    }
    return result;
  }

  std::string_view m_content, m_appended;
  bool m_appendedRaw = false;
  Complaints m_complaints;
  vtkNew<vtkXMLDataParser> m_parser;
  vtkXMLDataElement* m_root = nullptr;
  vtkSmartPointer<vtkDataCompressor> m_compressor;
  Encoding m_encoding = Encoding::LittleEndian;
  NumberType m_headerType = NumberType::UInt32;
  Polygons m_polygons;
};

}  // namespace

Polygons readStl(std::string_view content, const std::string& path) {
  checkBinaryStlLength(content);
  Complaints complaints;
  vtkNew<vtkSTLReader> reader;
  complaints.watch(reader);
  complaints.watch(reader->GetExecutive());
  reader->MergingOff();  // VTK's merging drops facets without area
  reader->SetFileName(path.c_str());
  reader->Update();
  complaints.throwIfAny();

  Polygons polygons;
  vtkPolyData* data = reader->GetOutput();
  polygons.positions.resize(static_cast<std::size_t>(data->GetNumberOfPoints()));
  for (std::size_t v = 0; v < polygons.positions.size(); ++v) {
    data->GetPoint(static_cast<vtkIdType>(v), polygons.positions[v].data());
    if (!polygons.positions[v].allFinite())
      return polygons;  // refused later; it has no place in an order
  }
  for (std::int64_t v = 0; v + 2 < data->GetNumberOfPoints(); v += 3)
    polygons.addPolygon({v, v + 1, v + 2});
  mergeVertices(polygons);
  return polygons;
}

Polygons readVtp(std::string_view content) { return VtpReader(content).read(); }

}  // namespace palpate::vtk
