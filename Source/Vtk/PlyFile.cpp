#include "Vtk/FileText.h"
#include "Vtk/MeshFile.h"

#include <map>
#include <optional>

namespace palpate::vtk {

// Read here and not by VTK 9.1, whose reader corrupts memory on a truncated file.

namespace {

struct Property {
  std::string name;
  NumberType type;
  std::optional<NumberType> countType;  ///< of a list
};

struct Element {
  std::string name;
  std::size_t count;
  std::vector<Property> properties;
};

struct Header {
  Encoding encoding = Encoding::Ascii;
  std::vector<Element> elements;
};

NumberType typeNamed(std::string_view name) {
  static const std::map<std::string_view, NumberType> types{
      {"char", NumberType::Int8},      {"int8", NumberType::Int8},
      {"uchar", NumberType::UInt8},    {"uint8", NumberType::UInt8},
      {"short", NumberType::Int16},    {"int16", NumberType::Int16},
      {"ushort", NumberType::UInt16},  {"uint16", NumberType::UInt16},
      {"int", NumberType::Int32},      {"int32", NumberType::Int32},
      {"uint", NumberType::UInt32},    {"uint32", NumberType::UInt32},
      {"float", NumberType::Float32},  {"float32", NumberType::Float32},
      {"double", NumberType::Float64}, {"float64", NumberType::Float64}};
  const auto found = types.find(name);
  if (found == types.end())
    throw FileFault{"its PLY header names an unknown type \"" + std::string(name) + "\""};
  return found->second;
}

Property readProperty(FileText& line) {
  const std::string_view type = line.word();
  if (type != "list") {
    const NumberType scalar = typeNamed(type);
    return {std::string(line.word()), scalar, {}};
  }
  const NumberType count = typeNamed(line.word());
  const NumberType item = typeNamed(line.word());
  return {std::string(line.word()), item, count};
}

Encoding encodingNamed(std::string_view name) {
  if (name == "ascii") return Encoding::Ascii;
  if (name == "binary_little_endian") return Encoding::LittleEndian;
  if (name == "binary_big_endian") return Encoding::BigEndian;
  throw FileFault{"its PLY header names an unknown format"};
}

Header readHeader(FileText& text) {
  if (text.line() != "ply") throw FileFault{"it does not begin as a PLY file"};
  Header header;
  while (!text.atEnd()) {
    FileText line(text.line());
    const std::string_view keyword = line.word();
    if (keyword == "end_header") return header;
    if (keyword == "format") header.encoding = encodingNamed(line.word());
    if (keyword == "element") {
      std::string name(line.word());
      const std::int64_t count = line.integer(NumberType::Int64, Encoding::Ascii);
      // Each element takes at least a byte.
      if (count < 0 || static_cast<std::uint64_t>(count) > text.left()) {
        throw FileFault{"it is shorter than its own counts say"};
      }
      header.elements.push_back({std::move(name), static_cast<std::size_t>(count), {}});
    } else if (keyword == "property") {
      if (header.elements.empty()) throw FileFault{"its PLY header has a property of no element"};
      header.elements.back().properties.push_back(readProperty(line));
    }
  }
  throw FileFault{"its PLY header ends too early"};
}

class Body {
 public:
  Body(FileText& text, Encoding encoding) : m_text(text), m_encoding(encoding) {}

  void read(const Element& element) {
    for (std::size_t i = 0; i < element.count; ++i) {
      if (element.name == "vertex") polygons.positions.emplace_back(Eigen::Vector3d::Zero());
      for (const Property& property : element.properties) {
        property.countType ? readList(element, property) : readScalar(element, property);
      }
    }
  }

  Polygons polygons;

 private:
  void readScalar(const Element& element, const Property& property) {
    const double value = m_text.number(property.type, m_encoding);
    const bool coordinate =
        property.name.size() == 1 && property.name[0] >= 'x' && property.name[0] <= 'z';
    if (element.name == "vertex" && coordinate)
      polygons.positions.back()[property.name[0] - 'x'] = value;
  }

  void readList(const Element& element, const Property& property) {
    const std::int64_t count = m_text.integer(*property.countType, m_encoding);
    if (count < 0) throw FileFault{"one of its lists has no length"};
    std::vector<std::int64_t> list;
    for (std::int64_t i = 0; i < count; ++i)
      list.push_back(m_text.integer(property.type, m_encoding));
    if (property.name != "vertex_indices" && property.name != "vertex_index") return;
    if (element.name == "tristrips") return addStrips(list);
    if (element.name != "face") return;
    polygons.addPolygon(list);
  }

  /// Strips one after the other, parted by -1.
  void addStrips(const std::vector<std::int64_t>& list) {
    std::vector<std::int64_t> strip;
    for (const std::int64_t corner : list) {
      if (corner != -1) {
        strip.push_back(corner);
      } else {
        polygons.addStrip(strip);
        strip.clear();
      }
    }
    if (!strip.empty()) polygons.addStrip(strip);
  }

  FileText& m_text;
  Encoding m_encoding;
};

}  // namespace

Polygons readPly(std::string_view content) {
  FileText text(content);
  const Header header = readHeader(text);
  Body body(text, header.encoding);
  for (const Element& element : header.elements) body.read(element);
  return std::move(body.polygons);
}

}  // namespace palpate::vtk
