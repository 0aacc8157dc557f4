// Part of MeshFiles/Formats.h: PLY files.

#include "MeshFiles/Formats.h"
#include "MeshFiles/Output.h"

#include <optional>
#include <string>
#include <vector>

// Source: "The PLY Polygon File Format", Turk, 1994; and the elements tristrips and edge of the
// Stanford repository's tools.

namespace palpate::files {

namespace {

struct Property {
  std::string_view name;
  NumberType type;
  std::optional<NumberType> countType;  ///< of a list

  bool isCorners() const { return countType && name.starts_with("vertex_ind"); }
  /// The axis of a coordinate; none of any other property.
  std::optional<int> axis() const {
    const bool isAxis = !countType && (name == "x" || name == "y" || name == "z");
    return isAxis ? std::optional(name[0] - 'x') : std::nullopt;
  }
};

struct Element {
  std::string_view name;
  std::size_t count;
  std::vector<Property> properties;

  template <class Test>
  bool has(Test&& test) const {
    for (const Property& property : properties)
      if (test(property)) return true;
    return false;
  }
};

Property readProperty(FileText& line) {
  const std::string_view type = line.word();
  if (type != "list") {
    const NumberType number = line.typeNamed(type);
    return {line.keyword(), number, {}};
  }
  const NumberType countType = line.typeNamed(line.word()), itemType = line.typeNamed(line.word());
  return {line.keyword(), itemType, countType};
}

Encoding readFormat(FileText& line) {
  const std::string_view name = line.word();
  if (name == "ascii") return Encoding::Text;
  if (name == "binary_little_endian") return Encoding::LittleEndian;
  if (name == "binary_big_endian") return Encoding::BigEndian;
  line.refuseWord("ascii, binary_little_endian or binary_big_endian", name);
}

std::vector<Element> readHeader(FileText& text, Encoding& encoding) {
  if (const std::string_view first = text.line(); first != "ply") text.refuseWord("ply", first);
  std::vector<Element> elements;
  while (text.left() > 0) {
    FileText line = text.part(text.line());
    const std::string_view keyword = line.word();
    if (keyword == "end_header") return elements;
    if (keyword == "format") {
      encoding = readFormat(line);
    } else if (keyword == "element") {
      const std::string_view name = line.keyword();
      const std::int64_t count = line.whole();
      if (count < 0) line.refuse("expected a count, not " + std::to_string(count));
      elements.push_back({name, static_cast<std::size_t>(count), {}});
    } else if (keyword == "property") {
      if (elements.empty()) line.refuse("expected an element before its first property");
      elements.back().properties.push_back(readProperty(line));
    } else if (keyword != "comment" && keyword != "obj_info") {
      line.refuseWord("a line of the PLY header", keyword);
    }
  }
  text.refuseWord("end_header", "");
}

/// The least number of bytes that an item of the element takes.
std::size_t leastSize(const Element& element, const FileText& text) {
  std::size_t size = 0;
  for (const Property& property : element.properties)
    size += text.isText() ? 2 : property.countType.value_or(property.type).size;
  return size;
}

void checkElement(const Element& element, const FileText& text) {
  if (element.count == 0) return;
  if (element.properties.empty())
    text.refuse("element " + std::string(element.name.substr(0, 40)) + ": expected properties");
  text.checkCount(element.count, "items of an element", leastSize(element, text));
  const auto isAxis = [](int axis) {
    return [axis](const Property& p) { return p.axis() == axis; };
  };
  if (element.name == "vertex" &&
      !(element.has(isAxis(0)) && element.has(isAxis(1)) && element.has(isAxis(2))))
    text.refuse("element vertex: expected the properties x, y and z");
  const bool hasCorners = element.has([](const Property& p) { return p.isCorners(); });
  const bool isKnown = element.name == "face" || element.name == "tristrips";
  if (hasCorners && !isKnown) text.refuseWord("corners of faces or tristrips", element.name);
  if (isKnown && !hasCorners)
    text.refuse("element " + std::string(element.name) + ": expected the list vertex_indices");
}

/// Reads the corners of a face, or of triangle strips that are separated by -1, or skips a list.
void readList(FileText& text, const Property& property, const Element& element, MeshBuilder& mesh) {
  const bool isStrips = element.name == "tristrips";
  const std::size_t count = text.asCount(text.number(*property.countType), "items of a list",
                                         text.isText() ? 2 : property.type.size);
  if (!property.isCorners()) return text.skip(property.type, count);
  mesh.reserveCorners(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double corner = text.number(property.type);
    if (isStrips && corner == -1.0)
      mesh.endCell(Cell::Strip, text);
    else
      mesh.addCorner(corner, text);
  }
  if (!isStrips || mesh.openCorners() > 0)
    mesh.endCell(isStrips ? Cell::Strip : Cell::Polygon, text);
}

void readItem(FileText& text, const Element& element, MeshBuilder& mesh) {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (const Property& property : element.properties) {
    if (property.countType) {
      readList(text, property, element, mesh);
      continue;
    }
    const double value = text.number(property.type);
    if (const auto axis = property.axis()) position[*axis] = value;
    const bool isEnd = property.name == "vertex1" || property.name == "vertex2";
    if (element.name == "edge" && isEnd) mesh.addCorner(value, text);
  }
  if (element.name == "vertex") mesh.addPosition(position, text);
  if (element.name == "edge") mesh.endCell(Cell::Polyline, text);
}

}  // namespace

void readPly(FileText text, MeshBuilder& mesh) {
  Encoding encoding = Encoding::Text;
  const std::vector<Element> elements = readHeader(text, encoding);
  text.setEncoding(encoding);
  for (const Element& element : elements) {
    checkElement(element, text);
    if (element.name == "vertex") mesh.reservePositions(element.count);
    for (std::size_t i = 0; i < element.count; ++i) readItem(text, element, mesh);
  }
}

std::string writePly(const MeshArrays& mesh, const MeshWriteSettings& settings) {
  Output out(settings.binary ? Encoding::LittleEndian : Encoding::Text);
  out.text("ply\nformat ").text(settings.binary ? "binary_little_endian" : "ascii");
  out.text(" 1.0\nelement vertex ").decimal(mesh.positions.size());
  out.text("\nproperty double x\nproperty double y\nproperty double z\nelement face ");
  out.decimal(mesh.triangles.size())
      .text("\nproperty list uchar int vertex_indices\nelement edge ");
  out.decimal(mesh.segments.size())
      .text("\nproperty int vertex1\nproperty int vertex2\nend_header\n");
  for (const Eigen::Vector3d& p : mesh.positions) out.numbers<double>(p).endLine();
  for (const Triangle& triangle : mesh.triangles)
    out.number(std::uint8_t{3}).numbers<std::int32_t>(triangle).endLine();
  for (const Segment& segment : mesh.segments) out.numbers<std::int32_t>(segment).endLine();
  return out.take();
}

}  // namespace palpate::files
