#include "Vtk/FileText.h"
#include "Vtk/MeshFile.h"

#include <vtkBase64Utilities.h>
#include <vtkCallbackCommand.h>
#include <vtkDataCompressor.h>
#include <vtkExecutive.h>
#include <vtkLZ4DataCompressor.h>
#include <vtkLZMADataCompressor.h>
#include <vtkMergePoints.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSTLReader.h>
#include <vtkSmartPointer.h>
#include <vtkXMLDataElement.h>
#include <vtkXMLDataParser.h>
#include <vtkZLibDataCompressor.h>

#include <algorithm>
#include <array>
#include <cctype>
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
  FileText facetList(content.substr(kHeader), Encoding::LittleEndian);
  const double facets = facetList.number(typeNamed("UInt32"));
  if (static_cast<double>(facetList.left() / kFacet) < facets) throw FileFault{"it ends too early"};
}

/// Up to what is none; padding ends a group, not the text.
std::string fromBase64(std::string_view text) {
  std::string bytes, group;
  for (const char c : text) {
    if (std::isspace(static_cast<unsigned char>(c))) continue;
    if ((group += c).size() < 4) continue;
    std::array<unsigned char, 3> decoded;
    const int count = vtkBase64Utilities::DecodeTriplet(group[0], group[1], group[2], group[3],
                                                        &decoded[0], &decoded[1], &decoded[2]);
    const std::size_t padding = group.find('=');  // VTK takes it anywhere
    if (count == 0 || padding < 2 || group.find_first_not_of('=', padding) != group.npos) break;
    bytes.append(decoded.begin(), decoded.begin() + count);
    group.clear();
  }
  return bytes;
}

/// The arrays of a VTP file, whose XML VTK parses and whose blocks VTK uncompresses. VTK 9.1's own
/// reader of it prints past its observers, divides by a damaged header's zero, and allocates and
/// copies what its sizes say.
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
    if (attribute(m_root, "byte_order") == "BigEndian") m_encoding = Encoding::BigEndian;
    if (attribute(m_root, "header_type") == "UInt64") m_headerType = typeNamed("UInt64");
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

  /// What a file of this length can hold: compression makes a number a thousandth of a byte, hardly
  /// less.
  std::size_t mostNumbers() const { return 1000 * m_content.size(); }

  std::size_t count(vtkXMLDataElement* piece, const char* name) const {
    const std::string text = attribute(piece, name);
    return text.empty() ? 0 : FileText(text).count(mostNumbers());
  }

  void readPiece(vtkXMLDataElement* piece) {
    const std::size_t first = m_polygons.positions.size(), points = count(piece, "NumberOfPoints");
    if (points > 0) m_polygons.addPositions(readArray(piece, "Points", "", 3 * points));
    readCells(piece, "Polys", count(piece, "NumberOfPolys"), first, false);
    readCells(piece, "Strips", count(piece, "NumberOfStrips"), first, true);
  }

  void readCells(vtkXMLDataElement* piece, const char* group, std::size_t cells, std::size_t first,
                 bool strips) {
    if (cells == 0) return;
    std::vector<double> offsets = readArray(piece, group, "offsets", cells);
    offsets.insert(offsets.begin(), 0.0);
    if (!isCount(offsets.back(), mostNumbers()))
      throw FileFault{"the offsets of its cells are not ascending or run past their corners"};
    const std::size_t points = m_polygons.positions.size() - first;
    std::vector<double> corners =
        readArray(piece, group, "connectivity", static_cast<std::size_t>(offsets.back()));
    for (double& corner : corners) {  // one that is not of the piece becomes wrong in the whole
      const bool own = corner >= 0 && corner < static_cast<double>(points);
      corner = own ? corner + static_cast<double>(first) : -1;
    }
    m_polygons.addCells(offsets, corners, strips);
  }

  /// The array of that name in a group of the piece; the first one if the name is empty.
  std::vector<double> readArray(vtkXMLDataElement* piece, const char* group, std::string_view name,
                                std::size_t size) {
    if (vtkXMLDataElement* parent = piece->FindNestedElementWithName(group)) {
      for (int i = 0; i < parent->GetNumberOfNestedElements(); ++i) {
        vtkXMLDataElement* array = parent->GetNestedElement(i);
        if (name.empty() || attribute(array, "Name") == name) return numbersOf(array, size);
      }
    }
    throw FileFault{"it lacks an array of its " + std::string(group)};
  }

  std::vector<double> numbersOf(vtkXMLDataElement* array, std::size_t size) {
    const NumberType type = typeNamed(attribute(array, "type"));
    const std::string format = attribute(array, "format");
    if (format != "appended" && format != "binary")
      return FileText(textOf(array)).numbers(type, size);
    std::string block;
    if (format == "appended") {
      const std::string offset = attribute(array, "offset");
      const std::string_view start = m_appended.substr(FileText(offset).count(m_appended.size()));
      block = m_appendedRaw ? std::string(start) : fromBase64(start);
    } else {
      block = fromBase64(textOf(array));
    }
    return FileText(uncompressed(block, size * type.size), m_encoding).numbers(type, size);
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

  /// A block's bytes behind its header: its length; or the number of compressed blocks, their
  /// length and the last one's (0: as the others) before compression, and the lengths after it.
  std::string_view uncompressed(std::string_view block, std::size_t expected) {
    FileText text(block, m_encoding);
    if (m_compressor == nullptr) return text.take(length(text));
    const std::size_t blocks = length(text), whole = length(text), last = length(text);
    const std::vector<double> lengths = text.numbers(m_headerType, blocks);
    m_uncompressed.clear();
    for (std::size_t i = 0; i < blocks; ++i) {
      const std::size_t size = i + 1 == blocks && last > 0 ? last : whole;
      const std::size_t start = m_uncompressed.size();
      if (size > expected - start || !isCount(lengths[i], text.left()))  // nothing beyond
        throw FileFault{"one of its compressed blocks has a wrong size"};
      const std::string_view compressed = text.take(static_cast<std::size_t>(lengths[i]));
      m_uncompressed.resize(start + size);
      const std::size_t got = m_compressor->Uncompress(
          reinterpret_cast<const unsigned char*>(compressed.data()), compressed.size(),
          reinterpret_cast<unsigned char*>(m_uncompressed.data() + start), size);
      m_complaints.throwIfAny();
      if (got != size) throw FileFault{"one of its compressed blocks is damaged"};
    }
    return m_uncompressed;
  }

  std::size_t length(FileText& text) const {
    return static_cast<std::size_t>(text.integer(m_headerType));
  }

  std::string_view m_content, m_appended;
  bool m_appendedRaw = false;
  std::string m_uncompressed;
  Complaints m_complaints;
  vtkNew<vtkXMLDataParser> m_parser;
  vtkXMLDataElement* m_root = nullptr;
  vtkSmartPointer<vtkDataCompressor> m_compressor;
  Encoding m_encoding = Encoding::LittleEndian;
  NumberType m_headerType = typeNamed("UInt32");
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

  vtkPolyData* data = reader->GetOutput();
  std::vector<Eigen::Vector3d> corners;
  for (vtkIdType i = 0; i < data->GetNumberOfPoints(); ++i) {
    corners.emplace_back(data->GetPoint(i));
    if (!corners.back().allFinite()) return {corners, {}, {}};  // refused later
  }
  Polygons polygons;
  vtkNew<vtkPoints> points;
  vtkNew<vtkMergePoints> merged;
  merged->InitPointInsertion(points, data->GetBounds(), data->GetNumberOfPoints());
  for (const Eigen::Vector3d& corner : corners) {
    vtkIdType vertex;
    if (merged->InsertUniquePoint(corner.data(), vertex)) polygons.positions.push_back(corner);
    polygons.corners.push_back(static_cast<double>(vertex));
    if (polygons.corners.size() % 3 == 0) polygons.ends.push_back(polygons.corners.size());
  }
  return polygons;
}

Polygons readVtp(std::string_view content) { return VtpReader(content).read(); }

}  // namespace palpate::vtk
