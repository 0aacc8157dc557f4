#pragma once

#include <palpate/vtk/MeshFile.h>

#include <span>
#include <string>
#include <string_view>

namespace palpate::vtk {

/// Why a file is rejected: the part of the message after the file's name.
struct FileFault {
  std::string reason;
};

struct NumberType {
  std::size_t size;  ///< bytes
  double (*decode)(const char* bytes);
};

/// The type that any of the formats calls by this name. Throws FileFault if there is none.
NumberType typeNamed(std::string_view name);
double toNumber(std::string_view word);                ///< throws FileFault if it is no number
std::size_t toCount(double number, std::size_t most);  ///< throws unless whole and in [0, most]
enum class Encoding { Ascii, LittleEndian, BigEndian };

/// Reads a file's content from front to back. Throws FileFault where it ends too early or where a
/// number is malformed.
class FileText {
 public:
  explicit FileText(std::string_view content, Encoding encoding = Encoding::Ascii)
      : m_rest(content), m_encoding(encoding) {}
  void setEncoding(Encoding encoding) { m_encoding = encoding; }

  std::size_t left() const { return m_rest.size(); }  ///< bytes
  std::string_view line();                            ///< without its end; empty at the end
  std::string_view word();  ///< between white space, across lines; empty at the end
  std::string_view take(std::size_t bytes);
  double number(NumberType type = typeNamed("double"));
  std::vector<double> numbers(NumberType type, std::size_t count);
  std::size_t count() { return toCount(toNumber(word()), left()); }  ///< at most the bytes left

 private:
  std::string_view m_rest;
  Encoding m_encoding;
};

/// The polygons of a file in any format, with unchecked corners.
struct Polygons {
  std::vector<Eigen::Vector3d> positions;
  std::vector<std::vector<double>> corners;

  void addPositions(const std::vector<double>& coordinates);
  void addStrip(std::span<const double> strip);
  /// Cell i: corners [offsets[i], offsets[i + 1]) of `all`.
  void addCells(std::span<const double> offsets, std::span<const double> all, bool strips);
};

// One reader for each format. It takes the file's content, and throws FileFault if that is
// malformed.
Polygons readObj(std::string_view content);
Polygons readPly(std::string_view content);
Polygons readLegacyVtk(std::string_view content);
Polygons readStl(std::string_view content);
Polygons readVtp(std::string_view content);

}  // namespace palpate::vtk
