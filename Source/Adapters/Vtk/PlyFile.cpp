#include "Vtk/MeshFile.h"

#include <optional>
#include <string>
#include <vector>

namespace palpate::vtk {

// These files are not read by VTK 9.1: its reader crashes on almost any truncated or damaged file,
// and converts doubles to floats.

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

Property readProperty(FileText& line) {
  const std::string_view type = line.word();
  if (type != "list") return {std::string(line.word()), typeNamed(type), {}};
  const NumberType countType = typeNamed(line.word()), itemType = typeNamed(line.word());
  return {std::string(line.word()), itemType, countType};
}

Encoding encodingNamed(std::string_view name) {
  if (name == "ascii") return Encoding::Ascii;
  if (name == "binary_little_endian") return Encoding::LittleEndian;
  if (name == "binary_big_endian") return Encoding::BigEndian;
  throw FileFault{"its PLY header has an unknown format"};
}

std::vector<Element> readHeader(FileText& text) {
  if (text.line() != "ply") throw FileFault{"it does not begin as a PLY file"};
  std::vector<Element> elements;
  while (text.left() > 0) {
    FileText line(text.line());
    const std::string_view keyword = line.word();
    if (keyword == "end_header") return elements;
    if (keyword == "format") text.setEncoding(encodingNamed(line.word()));
    if (keyword == "element") {
      std::string name(line.word());
      elements.push_back({std::move(name), toCount(line.number(), text.left()), {}});
    } else if (keyword == "property") {
      if (elements.empty())
        throw FileFault{"its PLY header has a property before the first element"};
      elements.back().properties.push_back(readProperty(line));
    }
  }
  throw FileFault{"its PLY header is truncated"};
}

/// The axis of a coordinate's property; none of any other.
std::optional<int> axisOf(const Property& property) {
  const bool isAxis = !property.countType && property.name.size() == 1 && property.name >= "x" &&
                      property.name <= "z";
  return isAxis ? std::optional(property.name[0] - 'x') : std::nullopt;
}

/// The least number of bytes that an item of the element takes.
std::size_t leastSize(const Element& element, Encoding encoding) {
  std::size_t size = 0;
  for (const Property& property : element.properties)
    size += encoding == Encoding::Ascii ? 2 : property.countType.value_or(property.type).size;
  return size;
}

void checkElement(const Element& element, const FileText& text) {
  std::size_t axes = 0;
  for (const Property& property : element.properties) axes += axisOf(property).has_value();
  if (element.name == "vertex" && element.count > 0 && axes < 3)
    throw FileFault{"its vertices lack a coordinate"};
  // The last item need not end with white space.
  if (element.count > 0 && (element.count - 1) * leastSize(element, text.encoding()) > text.left())
    throw FileFault{"it is shorter than its counts require"};
}

/// Reads the corners of a face, or of triangle strips that are separated by -1, or skips a list.
void readList(FileText& text, const Property& property, std::string_view element,
              Polygons& polygons) {
  const bool isCorners = property.name.starts_with("vertex_ind");
  const bool isFace = isCorners && element == "face",
             isStrips = isCorners && element == "tristrips";
  for (std::size_t left = toCount(text.number(*property.countType), text.left()); left > 0;
       --left) {
    const double corner = text.number(property.type);
    if (isStrips && corner == -1.0)
      polygons.endCell(true);
    else if (isFace || isStrips)
      polygons.addCorner(corner);
  }
  if (isFace || (isStrips && polygons.hasOpenCell())) polygons.endCell(isStrips);
}

}  // namespace

Polygons readPly(std::string_view content) {
  FileText text(content);
  Polygons polygons;
  for (const Element& element : readHeader(text)) {
    checkElement(element, text);
    const bool isVertex = element.name == "vertex";
    if (isVertex) polygons.reservePositions(element.count);
    for (std::size_t i = element.properties.empty() ? element.count : 0; i < element.count; ++i) {
      Eigen::Vector3d position = Eigen::Vector3d::Zero();
      for (const Property& property : element.properties) {
        if (property.countType) {
          readList(text, property, element.name, polygons);
          continue;
        }
        const double value = text.number(property.type);
        if (const auto axis = axisOf(property)) position[*axis] = value;
      }
      if (isVertex) polygons.addPosition(position);
    }
  }
  return polygons;
}

}  // namespace palpate::vtk
