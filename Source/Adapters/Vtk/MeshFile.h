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
  Encoding encoding() const { return m_encoding; }

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

/// The polygons and triangle strips of a file in any format. A file's content may be hostile: each
/// list grows only by what the file really has.
class Polygons {
 public:
  void reservePositions(std::size_t more);
  void addPosition(const Eigen::Vector3d& position) { m_positions.push_back(position); }
  void addPositions(const std::vector<double>& coordinates);
  void clearPositions() { m_positions.clear(); }
  std::size_t positionCount() const { return m_positions.size(); }

  /// Adds a corner to the polygon or strip that endCell() will end: the position with this index
  /// after `first`, of `count` ones. A corner out of range is refused by mesh().
  void addCorner(double index, std::size_t first = 0, std::size_t count = kNoCorner);
  bool hasOpenCell() const { return openCorners() > 0; }
  void endCell(bool isStrip);  ///< throws FileFault if it has fewer than three corners
  /// Cell i: corners [offsets[i], offsets[i + 1]) of `all`.
  void addCells(std::span<const double> offsets, std::span<const double> all, bool strips,
                std::size_t first = 0, std::size_t count = kNoCorner);

  MeshFile mesh() &&;  ///< throws FileFault for positions and corners that are not valid

 private:
  static constexpr std::uint32_t kNoCorner = 0xffffffff;
  struct Cell {
    std::size_t isStrip : 1, end : 63;
  };
  std::size_t openCorners() const;
  void checkPositions() const;

  std::vector<Eigen::Vector3d> m_positions;
  std::vector<std::uint32_t> m_corners;
  std::vector<Cell> m_cells;
};

// One reader for each format. It takes the file's content, and throws FileFault if that is
// malformed.
Polygons readObj(std::string_view content);
Polygons readPly(std::string_view content);
Polygons readLegacyVtk(std::string_view content);
Polygons readStl(std::string_view content);
Polygons readVtp(std::string_view content);

}  // namespace palpate::vtk
