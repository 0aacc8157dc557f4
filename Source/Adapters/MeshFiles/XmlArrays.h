#pragma once

#include "MeshFiles/Output.h"
#include "MeshFiles/VtkCells.h"

#include <deque>
#include <string>
#include <string_view>

namespace palpate::files {

/// The pieces and arrays of a VTK XML file.
class XmlArrays {
 public:
  explicit XmlArrays(const FileText& file);

  /// Calls visit(piece) for each piece of a data set, such as "PolyData".
  template <class F>
  void forPieces(std::string_view dataSet, F&& visit) {
    const std::string_view data = elementIn(m_xml, dataSet);
    for (std::size_t at = data.find("<Piece"); at != data.npos; at = data.find("<Piece", at)) {
      const std::string_view piece = elementIn(data.substr(at), "Piece");
      visit(piece);
      at += piece.size();
      m_decoded.clear();
    }
  }

  /// An attribute of the piece, such as "NumberOfPoints"; 0 if there is none.
  std::size_t count(std::string_view piece, std::string_view attribute) const;
  /// The array of that name in a group of the piece; the first one if the name is empty. It is
  /// valid until the next piece.
  NumberArray array(std::string_view piece, std::string_view group, std::string_view name);

 private:
  enum class Compressor { None, ZLib, Lz4 };
  std::string_view elementIn(std::string_view text, std::string_view name) const;
  [[noreturn]] void refuse(std::string_view at, const std::string& reason) const;
  Compressor compressorNamed(std::string_view name) const;
  std::size_t asSize(double, std::size_t most, std::string_view at) const;
  std::string stored(std::string_view text, bool isRaw, std::size_t size);
  std::string plainBytes(std::string_view text, bool isRaw);
  std::string inflatedBytes(std::string_view text, bool isRaw);
  FileText numbersOf(const std::string& bytes, std::string_view at) const;

  FileText m_file;
  std::string_view m_xml, m_appended;
  /// Bytes of arrays that may still be read, as they are stored and when they are decoded.
  std::size_t m_storedLeft, m_decodedLeft;
  bool m_isRaw = false;  ///< the appended data
  Compressor m_compressor = Compressor::None;
  Encoding m_encoding = Encoding::LittleEndian;
  NumberType m_headerType;
  std::deque<std::string> m_decoded;  ///< of this piece; references stay valid
};

/// A VTK XML file of one piece that is being written.
class XmlOutput {
 public:
  XmlOutput(std::string_view dataSet, bool isBinary);
  /// The attributes of the piece.
  void start(const std::vector<std::pair<std::string_view, std::size_t>>& counts);
  void openGroup(std::string_view name) { m_xml.text("<").text(name).text(">\n"); }
  void closeGroup(std::string_view name) { m_xml.text("</").text(name).text(">\n"); }
  /// An array of the type T, to which fill(output) adds `count` numbers.
  template <class T, class F>
  void addArray(std::string_view type, std::string_view name, int components, std::size_t count,
                F&& fill) {
    m_xml.text("<DataArray type=\"").text(type).text("\" Name=\"").text(name);
    m_xml.text("\" NumberOfComponents=\"").decimal(components);
    if (m_isBinary) {
      m_xml.text("\" format=\"appended\" offset=\"").decimal(m_appended.size()).text("\"/>\n");
      m_appended.number(std::uint64_t{count * sizeof(T)});
      return fill(m_appended);
    }
    fill(m_xml.text("\" format=\"ascii\">\n"));
    m_xml.endLine().text("</DataArray>\n");
  }
  void addPositions(const std::vector<Eigen::Vector3d>&);
  std::string finish();

 private:
  std::string_view m_dataSet;
  bool m_isBinary;
  Output m_xml{Encoding::Text}, m_appended{Encoding::LittleEndian};
};

}  // namespace palpate::files
