#include "Vtk/MeshFile.h"

#include <vtkBase64Utilities.h>
#include <vtkCallbackCommand.h>
#include <vtkLZ4DataCompressor.h>
#include <vtkLZMADataCompressor.h>
#include <vtkNew.h>
#include <vtkSmartPointer.h>
#include <vtkZLibDataCompressor.h>

#include <algorithm>
#include <cctype>

namespace palpate::vtk {

// VTK 9.1 only decompresses the blocks of these files. Its reader is not used: it prints messages
// that observers do not receive, divides by a zero in a damaged header, and allocates and copies by
// unchecked sizes.

namespace {

/// Decodes at least `most` bytes of the text, or all up to the first group that is not Base64.
/// Padding ends a group, not the text.
std::string fromBase64(std::string_view text, std::size_t most) {
  std::string bytes, group;
  for (const char c : text) {
    if (bytes.size() >= most) break;
    if (std::isspace(static_cast<unsigned char>(c))) continue;
    if ((group += c).size() < 4) continue;
    unsigned char decoded[3];
    const int count = vtkBase64Utilities::DecodeTriplet(group[0], group[1], group[2], group[3],
                                                        decoded, decoded + 1, decoded + 2);
    const std::size_t padding = group.find('=');  // VTK accepts it anywhere
    if (count == 0 || padding < 2 || group.find_first_not_of('=', padding) != group.npos) break;
    bytes.append(decoded, decoded + count);
    group.clear();
  }
  return bytes;
}

/// The text from an element's first tag to its last.
std::string_view elementIn(std::string_view text, const std::string& name) {
  const std::size_t begin = text.find("<" + name), end = text.find("</" + name);
  if (begin == text.npos) throw FileFault{"it has no element " + name};
  if (end == text.npos || end < begin) throw FileFault{"it is truncated"};
  return text.substr(begin, end - begin);
}

/// The value of an attribute in an element's tag; empty if there is none.
std::string_view attributeOf(std::string_view element, const std::string& name) {
  const std::string_view tag = element.substr(0, element.find_first_of("<>", 1));
  const std::size_t begin = tag.find(" " + name + "=\"");
  if (begin == tag.npos) return "";
  const std::string_view value = tag.substr(begin + name.size() + 3);
  return value.substr(0, value.find('"'));
}

vtkSmartPointer<vtkDataCompressor> compressorNamed(std::string_view name) {
  if (name.empty()) return nullptr;
  vtkSmartPointer<vtkDataCompressor> compressor;
  if (name == "vtkZLibDataCompressor") compressor = vtkSmartPointer<vtkZLibDataCompressor>::New();
  if (name == "vtkLZ4DataCompressor") compressor = vtkSmartPointer<vtkLZ4DataCompressor>::New();
  if (name == "vtkLZMADataCompressor") compressor = vtkSmartPointer<vtkLZMADataCompressor>::New();
  if (compressor == nullptr) throw FileFault{"its compressor is unknown"};
  compressor->AddObserver(vtkCommand::ErrorEvent, vtkNew<vtkCallbackCommand>());  // prints nothing
  return compressor;
}

class Reader {
 public:
  explicit Reader(std::string_view content)
      : m_xml(content.substr(0, content.find("<AppendedData"))), m_storedLeft(2 * content.size()) {
    // Appended data need not be XML. They follow the "_" after their tag.
    const std::string_view appended = content.substr(m_xml.size());
    const std::size_t start = appended.find('_', appended.find('>'));
    if (start != appended.npos) m_appended = appended.substr(start + 1);
    m_raw = attributeOf(appended, "encoding") == "raw";
    const std::string_view file = m_xml.substr(std::min(m_xml.find("<VTKFile"), m_xml.size()));
    if (attributeOf(file, "byte_order") == "BigEndian") m_encoding = Encoding::BigEndian;
    if (attributeOf(file, "header_type") == "UInt64") m_headerType = typeNamed("UInt64");
    m_compressor = compressorNamed(attributeOf(file, "compressor"));
    m_decodedLeft = (m_compressor ? kMostCompression : 1) * content.size();
  }

  Polygons read() {
    const std::string_view data = elementIn(m_xml, "PolyData");
    for (std::size_t at = data.find("<Piece"); at != data.npos; at = data.find("<Piece", at)) {
      const std::string_view piece = elementIn(data.substr(at), "Piece");
      at += piece.size();
      const std::size_t first = m_polygons.positionCount(), points = count(piece, "Points");
      if (points > 0) m_polygons.addPositions(readArray(piece, "Points", "", 3 * points));
      for (const std::string group : {"Polys", "Strips"})
        if (const std::size_t cells = count(piece, group)) readCells(piece, group, cells, first);
    }
    return std::move(m_polygons);
  }

 private:
  std::size_t count(std::string_view piece, const std::string& group) const {
    const std::string_view text = attributeOf(piece, "NumberOf" + group);
    return text.empty() ? 0 : toCount(toNumber(text), m_decodedLeft);
  }

  void readCells(std::string_view piece, const std::string& group, std::size_t cells,
                 std::size_t first) {
    std::vector<double> offsets = readArray(piece, group, "offsets", cells);
    offsets.insert(offsets.begin(), 0.0);
    const std::vector<double> corners =
        readArray(piece, group, "connectivity", toCount(offsets.back(), m_decodedLeft));
    m_polygons.addCells(offsets, corners, group == "Strips", first,
                        m_polygons.positionCount() - first);
  }

  /// The array of that name in a group of the piece; the first one if the name is empty.
  std::vector<double> readArray(std::string_view piece, const std::string& group,
                                std::string_view name, std::size_t size) {
    std::string_view array = elementIn(piece, group);
    do {
      array = array.substr(std::min(array.find("<DataArray", 1), array.size()));
      if (array.empty()) throw FileFault{"its element " + group + " lacks an array"};
    } while (!name.empty() && attributeOf(array, "Name") != name);

    const NumberType type = typeNamed(attributeOf(array, "type"));
    const std::string_view format = attributeOf(array, "format");
    std::string_view text = array.substr(std::min(array.find('>') + 1, array.size()));
    text = text.substr(0, text.find('<'));
    if (format == "appended")
      text = m_appended.substr(toCount(toNumber(attributeOf(array, "offset")), m_appended.size()));
    else if (format != "binary")
      return FileText(text).numbers(type, size);
    const std::size_t expected = toCount(static_cast<double>(size * type.size), m_decodedLeft);
    m_decodedLeft -= expected;
    const std::string bytes = arrayBytes(text, m_raw && format == "appended", expected);
    return FileText(bytes, m_encoding).numbers(type, size);
  }

  /// The first bytes of a text, or all that it has, in Base64 or not. All calls together read no
  /// more than the file has, so that arrays that share their bytes do not take quadratic time.
  std::string stored(std::string_view text, bool raw, std::size_t size) {
    if (size > m_storedLeft) throw FileFault{"its arrays are longer than the file"};
    m_storedLeft -= size;
    return raw ? std::string(text.substr(0, size)) : fromBase64(text, size);
  }

  /// The bytes that follow an array's header, decompressed. Without compression the header is the
  /// length. Otherwise it is the number of compressed blocks, their length before compression, that
  /// of the last one (0: as the others), and all lengths after compression.
  std::string arrayBytes(std::string_view text, bool raw, std::size_t expected) {
    const auto length = [&](FileText& header) {
      return toCount(header.number(m_headerType), std::size_t{1} << 53);
    };
    const std::size_t word = m_headerType.size;
    if (m_compressor == nullptr) {
      const std::string bytes = stored(text, raw, word + expected);
      FileText array(bytes, m_encoding);
      const std::size_t declared = length(array);
      if (declared < expected) throw FileFault{"one of its arrays is shorter than its count"};
      return std::string(array.take(expected));
    }
    const std::string sizes = stored(text, raw, 3 * word);
    FileText fixed(sizes, m_encoding);
    const std::size_t blocks = length(fixed), fullSize = length(fixed), lastSize = length(fixed);
    const std::size_t headerSize = (3 + toCount(static_cast<double>(blocks), m_storedLeft)) * word;
    const std::string header = stored(text, raw, headerSize);
    FileText variable(header, m_encoding);
    variable.take(3 * word);
    const std::vector<double> lengths = variable.numbers(m_headerType, blocks);
    std::size_t total = headerSize;
    for (const double compressed : lengths) total += toCount(compressed, m_storedLeft);
    const std::string block = stored(text, raw, total);
    FileText compressed(block, m_encoding);
    compressed.take(headerSize);
    std::string bytes;
    for (std::size_t i = 0; i < blocks; ++i) {
      const std::size_t size = i + 1 == blocks && lastSize > 0 ? lastSize : fullSize,
                        start = bytes.size();
      if (size > expected - start) throw FileFault{"one of its compressed blocks has a wrong size"};
      const std::string_view packed = compressed.take(static_cast<std::size_t>(lengths[i]));
      bytes.resize(start + size);
      const std::size_t got = m_compressor->Uncompress(
          reinterpret_cast<const unsigned char*>(packed.data()), packed.size(),
          reinterpret_cast<unsigned char*>(bytes.data() + start), size);
      if (got != size) throw FileFault{"one of its compressed blocks is damaged"};
    }
    return bytes;
  }

  std::string_view m_xml, m_appended;
  /// Bytes of arrays that may still be read, as they are stored and when they are decoded. Zlib
  /// stores at most this many bytes in one.
  static constexpr std::size_t kMostCompression = 1032;
  std::size_t m_storedLeft, m_decodedLeft;
  bool m_raw = false;
  vtkSmartPointer<vtkDataCompressor> m_compressor;
  Encoding m_encoding = Encoding::LittleEndian;
  NumberType m_headerType = typeNamed("UInt32");
  Polygons m_polygons;
};

}  // namespace

Polygons readVtp(std::string_view content) { return Reader(content).read(); }

}  // namespace palpate::vtk
