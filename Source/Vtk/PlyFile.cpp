#include "Vtk/FileText.h"
#include "Vtk/MeshFile.h"

#include <algorithm>
#include <optional>

namespace palpate::vtk {

// Read here and not by VTK 9.1, whose reader crashes on almost any truncated or damaged file, and
// makes floats of doubles.

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
  std::optional<NumberType> countType;
  std::string_view type = line.word();
  if (type == "list") {
    countType = typeNamed(line.word());
    type = line.word();
  }
  return {std::string(line.word()), typeNamed(type), countType};
}

Encoding encodingNamed(std::string_view name) {
  if (name == "ascii") return Encoding::Ascii;
  if (name == "binary_little_endian") return Encoding::LittleEndian;
  if (name == "binary_big_endian") return Encoding::BigEndian;
  throw FileFault{"its PLY header names an unknown format"};
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
      elements.push_back({std::move(name), line.count(text.left()), {}});  // a byte each at least
    } else if (keyword == "property") {
      if (elements.empty()) throw FileFault{"its PLY header has a property of no element"};
      elements.back().properties.push_back(readProperty(line));
    }
  }
  throw FileFault{"its PLY header ends too early"};
}

/// Strips one after the other, parted by -1.
void addStrips(const std::vector<double>& list, Polygons& polygons) {
  for (auto begin = list.begin(); begin != list.end();) {
    const auto end = std::find(begin, list.end(), -1.0);
    polygons.addStrip({begin, end});
    begin = end == list.end() ? end : end + 1;
  }
}

void readList(FileText& text, const std::string& element, const Property& property,
              Polygons& polygons) {
  const double count = text.number(*property.countType);
  if (!isCount(count, text.left())) throw FileFault{"one of its lists has a wrong length"};
  const auto list = text.numbers(property.type, static_cast<std::size_t>(count));
  if (property.name != "vertex_indices" && property.name != "vertex_index") return;
  if (element == "tristrips") addStrips(list, polygons);
  if (element == "face") polygons.addPolygon(list);
}

}  // namespace

Polygons readPly(std::string_view content) {
  FileText text(content);
  Polygons polygons;
  for (const Element& element : readHeader(text)) {
    for (std::size_t i = 0; i < element.count; ++i) {
      Eigen::Vector3d position = Eigen::Vector3d::Zero();
      for (const Property& property : element.properties) {
        if (property.countType) {
          readList(text, element.name, property, polygons);
          continue;
        }
        const double value = text.number(property.type);
        if (property.name == "x") position.x() = value;
        if (property.name == "y") position.y() = value;
        if (property.name == "z") position.z() = value;
      }
      if (element.name == "vertex") polygons.positions.push_back(position);
    }
  }
  return polygons;
}

}  // namespace palpate::vtk
