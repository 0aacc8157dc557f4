#include "Vtk/MeshFile.h"

#include <algorithm>
#include <optional>

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

/// Adds the corners of a face, or triangle strips that are separated by -1.
void addList(const std::string& element, const std::vector<double>& list, Polygons& polygons) {
  if (element == "face") polygons.corners.push_back(list);
  for (auto begin = list.begin(); element == "tristrips" && begin != list.end();) {
    const auto end = std::find(begin, list.end(), -1.0);
    polygons.addStrip({begin, end});
    begin = end + (end != list.end());
  }
}

}  // namespace

Polygons readPly(std::string_view content) {
  FileText text(content);
  Polygons polygons;
  for (const Element& element : readHeader(text)) {
    for (std::size_t i = 0; i < element.count; ++i) {
      Eigen::Vector3d position = Eigen::Vector3d::Zero();
      for (const auto& [name, type, countType] : element.properties) {
        if (countType) {
          const std::size_t length = toCount(text.number(*countType), text.left());
          const std::vector<double> list = text.numbers(type, length);
          if (name.starts_with("vertex_ind")) addList(element.name, list, polygons);
          continue;
        }
        const double value = text.number(type);
        if (name.size() == 1 && name >= "x" && name <= "z") position[name[0] - 'x'] = value;
      }
      if (element.name == "vertex") polygons.positions.push_back(position);
    }
  }
  return polygons;
}

}  // namespace palpate::vtk
