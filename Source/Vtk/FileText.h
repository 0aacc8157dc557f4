#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace palpate::vtk {

enum class NumberType {
  Int8,
  UInt8,
  Int16,
  UInt16,
  Int32,
  UInt32,
  Int64,
  UInt64,
  Float32,
  Float64
};
enum class Encoding { Ascii, LittleEndian, BigEndian };

/// Reads a file's content from front to back; FileFault where it ends too early or holds no number.
class FileText {
 public:
  explicit FileText(std::string_view content) : m_rest(content) {}

  bool atEnd() const { return m_rest.empty(); }
  std::size_t left() const { return m_rest.size(); }  ///< bytes
  std::string_view line();                            ///< without its end; empty at the end
  std::string_view word();  ///< between white space, across lines; empty at the end
  std::string_view nextWord() const { return FileText(*this).word(); }
  std::string_view take(std::size_t bytes);
  double number(NumberType type, Encoding encoding);
  std::int64_t integer(NumberType type, Encoding encoding);
  std::size_t count();  ///< a word; at most the bytes left, so that it can be stored

 private:
  std::string_view m_rest;
};

std::size_t sizeOf(NumberType type);     ///< bytes
double toNumber(std::string_view word);  ///< FileFault if it is none
std::string fromBase64(
    std::string_view text);  ///< up to what is none; padding ends a group, not the text

}  // namespace palpate::vtk
