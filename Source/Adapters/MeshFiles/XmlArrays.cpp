#include "MeshFiles/XmlArrays.h"

#include "MeshFiles/Inflate.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

// Source: "VTK File Formats", Kitware: the XML formats.

namespace palpate::files {

namespace {

/// The value of an attribute in an element's tag; empty if there is none.
std::string_view attributeOf(std::string_view element, std::string_view name) {
  const std::string_view tag = element.substr(0, element.find_first_of("<>", 1));
  for (std::size_t at = tag.find(name, 1); at != tag.npos; at = tag.find(name, at + 1)) {
    const std::string_view rest = tag.substr(at + name.size());
    const bool isName = std::isspace(static_cast<unsigned char>(tag[at - 1])) != 0;
    if (!isName || !(rest.starts_with("=\"") || rest.starts_with("='"))) continue;
    return rest.substr(2, rest.find(rest[1], 2) - 2);
  }
  return "";
}

/// The text behind an element's tag.
std::string_view contentOf(std::string_view element) {
  const std::string_view text = element.substr(std::min(element.find('>'), element.size()));
  return text.substr(std::min<std::size_t>(1, text.size()), text.find('<') - 1);
}

int valueOf(char c) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const std::size_t value = kDigits.find(c);
  return value == kDigits.npos ? -1 : static_cast<int>(value);
}

/// Adds the one to three bytes of four digits. Nothing follows padding in a group.
bool appendGroup(std::string_view group, std::string& bytes) {
  const std::size_t digits = std::min(group.find('='), group.size());
  if (digits < 2 || group.find_first_not_of('=', digits) != group.npos) return false;
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const int value = i < digits ? valueOf(group[i]) : 0;
    if (value < 0) return false;
    bits = bits << 6 | static_cast<std::uint32_t>(value);
  }
  for (std::size_t i = 0; i + 1 < digits; ++i)
    bytes += static_cast<char>(bits >> (16 - 8 * i) & 0xff);
  return true;
}

/// Decodes at least `most` bytes of the text, or all up to the first group that is not Base64.
/// Padding ends a group, not the text.
std::string fromBase64(std::string_view text, std::size_t most) {
  std::string bytes, group;
  for (const char c : text) {
    if (bytes.size() >= most) break;
    if (std::isspace(static_cast<unsigned char>(c))) continue;
    if ((group += c).size() < 4) continue;
    if (!appendGroup(group, bytes)) break;
    group.clear();
  }
  return bytes;
}

constexpr std::size_t kMostCompression = 1032;  // ZLib stores at most this many bytes in one

}  // namespace

XmlArrays::XmlArrays(const FileText& file)
    : m_file(file),
      m_xml(file.rest().substr(0, file.rest().find("<AppendedData"))),
      m_storedLeft(2 * file.left()),
      m_headerType(file.typeNamed("UInt32")) {
  // Appended data need not be XML. They follow the "_" after their tag.
  const std::string_view appended = file.rest().substr(m_xml.size());
  const std::size_t start = appended.find('_', appended.find('>'));
  if (start != appended.npos) m_appended = appended.substr(start + 1);
  m_isRaw = attributeOf(appended, "encoding") == "raw";
  const std::size_t begin = m_xml.find("<VTKFile");
  if (begin == m_xml.npos) refuse(m_xml, "expected the element VTKFile");
  const std::string_view tag = m_xml.substr(begin);
  if (attributeOf(tag, "byte_order") == "BigEndian") m_encoding = Encoding::BigEndian;
  if (attributeOf(tag, "header_type") == "UInt64") m_headerType = file.typeNamed("UInt64");
  m_compressor = compressorNamed(attributeOf(tag, "compressor"));
  m_decodedLeft = (m_compressor == Compressor::None ? 1 : kMostCompression) * file.left();
}

void XmlArrays::refuse(std::string_view at, const std::string& reason) const {
  FileText part = m_file.part(at);
  const bool isAppended = !m_appended.empty() && at.data() >= m_appended.data();
  if (isAppended) part.setEncoding(m_encoding);
  part.refuse(reason);
}

XmlArrays::Compressor XmlArrays::compressorNamed(std::string_view name) const {
  if (name.empty()) return Compressor::None;
  if (name == "vtkZLibDataCompressor") return Compressor::ZLib;
  if (name == "vtkLZ4DataCompressor") return Compressor::Lz4;
  m_file.part(name).refuseWord("the compressor vtkZLibDataCompressor or vtkLZ4DataCompressor",
                               name);
}

/// The text from an element's first tag to its last.
std::string_view XmlArrays::elementIn(std::string_view text, std::string_view name) const {
  const std::size_t begin = text.find(std::string("<").append(name)),
                    end = text.find(std::string("</").append(name));
  if (begin == text.npos) refuse(text, "expected an element " + std::string(name));
  if (end == text.npos || end < begin)
    refuse(text.substr(begin), "expected the end of the element " + std::string(name));
  return text.substr(begin, end - begin);
}

std::size_t XmlArrays::asSize(double number, std::size_t most, std::string_view at) const {
  if (!(number >= 0 && number == std::floor(number) && number <= static_cast<double>(most)))
    refuse(at, "expected a number from 0 to " + std::to_string(most) + ", not " + shortest(number));
  return static_cast<std::size_t>(number);
}

std::size_t XmlArrays::count(std::string_view piece, std::string_view attribute) const {
  const std::string_view text = attributeOf(piece, attribute);
  return text.empty() ? 0 : asSize(m_file.part(text).number(), m_decodedLeft, text);
}

NumberArray XmlArrays::array(std::string_view piece, std::string_view group,
                             std::string_view name) {
  std::string_view array = elementIn(piece, group);
  do {
    const std::size_t next = array.find("<DataArray", 1);
    if (next == array.npos)
      refuse(array, "expected an array " + std::string(name) + " in " + std::string(group));
    array = array.substr(next);
  } while (!name.empty() && attributeOf(array, "Name") != name);

  const std::string_view typeName = attributeOf(array, "type"),
                         format = attributeOf(array, "format");
  const NumberType type = m_file.part(typeName.empty() ? array : typeName).typeNamed(typeName);
  std::string_view text = contentOf(array);
  if (format.empty() || format == "ascii") return {m_file.part(text), type};
  const bool isAppended = format == "appended";
  if (!isAppended && format != "binary")
    m_file.part(format).refuseWord("the format ascii, binary or appended", format);
  if (isAppended) {
    const std::string_view offset = attributeOf(array, "offset");
    text = m_appended.substr(
        asSize(m_file.part(offset.empty() ? array : offset).number(), m_appended.size(), array));
  }
  const bool isRaw = isAppended && m_isRaw;
  m_decoded.push_back(m_compressor == Compressor::None ? plainBytes(text, isRaw)
                                                       : inflatedBytes(text, isRaw));
  return {numbersOf(m_decoded.back(), text), type};
}

FileText XmlArrays::numbersOf(const std::string& bytes, std::string_view at) const {
  return m_file.decoded(bytes, m_encoding, at.data());
}

/// The first bytes of a text, or all that it has, in Base64 or not. All calls together read no
/// more than the file has, so that arrays that share their bytes do not take quadratic time.
std::string XmlArrays::stored(std::string_view text, bool isRaw, std::size_t size) {
  if (size > m_storedLeft) refuse(text, "expected arrays that are not longer than the file");
  m_storedLeft -= size;
  return isRaw ? std::string(text.substr(0, size)) : fromBase64(text, size);
}

/// An array's bytes, which follow their number.
std::string XmlArrays::plainBytes(std::string_view text, bool isRaw) {
  const std::size_t word = m_headerType.size;
  const std::string head = stored(text, isRaw, word);
  const std::size_t size = asSize(numbersOf(head, text).number(m_headerType), m_decodedLeft, text);
  m_decodedLeft -= size;
  std::string bytes = stored(text, isRaw, word + size);
  if (bytes.size() < word + size)
    numbersOf(bytes, text)
        .refuse("expected an array of " + std::to_string(size) + " bytes, not " +
                std::to_string(bytes.size() - word));
  return bytes.erase(word + size).erase(0, word);
}

/// The bytes that follow an array's header, decompressed. The header is the number of compressed
/// blocks, their length before compression, that of the last one (0: as the others), and all
/// lengths after compression.
std::string XmlArrays::inflatedBytes(std::string_view text, bool isRaw) {
  const std::size_t word = m_headerType.size;
  const std::string sizes = stored(text, isRaw, 3 * word);
  FileText fixed = numbersOf(sizes, text);
  const auto next = [&](FileText& from, std::size_t most) {
    return asSize(from.number(m_headerType), most, text);
  };
  const std::size_t blocks = next(fixed, m_storedLeft), fullSize = next(fixed, m_decodedLeft),
                    lastSize = next(fixed, fullSize), headSize = (3 + blocks) * word;
  const std::string head = stored(text, isRaw, headSize);
  FileText variable = numbersOf(head, text);
  variable.take(3 * word);
  std::vector<std::size_t> lengths;
  std::size_t total = headSize;
  for (std::size_t i = 0; i < blocks; ++i)
    total += lengths.emplace_back(next(variable, m_storedLeft));
  const std::string all = stored(text, isRaw, total);
  FileText packed = numbersOf(all, text);
  packed.take(headSize);
  std::string bytes;
  for (std::size_t i = 0; i < blocks; ++i) {
    const std::size_t size = i + 1 == blocks && lastSize > 0 ? lastSize : fullSize;
    if (size > m_decodedLeft) packed.refuse("expected fewer bytes in the file's arrays");
    m_decodedLeft -= size;
    const std::string_view block = packed.take(lengths[i]);
    const std::optional<std::string> plain =
        m_compressor == Compressor::ZLib ? inflateZlib(block, size) : inflateLz4(block, size);
    if (!plain) packed.refuse("expected a compressed block of " + std::to_string(size) + " bytes");
    bytes += *plain;
  }
  return bytes;
}

XmlOutput::XmlOutput(std::string_view dataSet, bool isBinary)
    : m_dataSet(dataSet), m_isBinary(isBinary) {
  m_xml.text("<?xml version=\"1.0\"?>\n<VTKFile type=\"").text(dataSet);
  m_xml.text("\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n");
  openGroup(dataSet);
}

void XmlOutput::start(const std::vector<std::pair<std::string_view, std::size_t>>& counts) {
  m_xml.text("<Piece");
  for (const auto& [name, count] : counts)
    m_xml.text(" ").text(name).text("=\"").decimal(count).text("\"");
  m_xml.text(">\n");
}

void XmlOutput::addPositions(const std::vector<Eigen::Vector3d>& positions) {
  openGroup("Points");
  addArray<double>("Float64", "Points", 3, 3 * positions.size(), [&](Output& out) {
    for (const Eigen::Vector3d& p : positions) out.numbers<double>(p);
  });
  closeGroup("Points");
}

std::string XmlOutput::finish() {
  closeGroup("Piece");
  closeGroup(m_dataSet);
  if (m_isBinary)
    m_xml.text("<AppendedData encoding=\"raw\">\n_")
        .text(m_appended.take())
        .text("\n</AppendedData>\n");
  return m_xml.text("</VTKFile>\n").take();
}

}  // namespace palpate::files
