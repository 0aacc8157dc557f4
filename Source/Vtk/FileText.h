#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace palpate::vtk {

struct NumberType {
  std::size_t size;  ///< bytes
  double (*decode)(const char* bytes);
};

/// By the name that any of the formats has for it; FileFault if none has.
NumberType typeNamed(std::string_view name);

enum class Encoding { Ascii, LittleEndian, BigEndian };

/// Reads a file's content from front to back; FileFault where it ends too early or holds no number.
class FileText {
 public:
  explicit FileText(std::string_view content, Encoding encoding = Encoding::Ascii)
      : m_rest(content), m_encoding(encoding) {}
  void setEncoding(Encoding encoding) { m_encoding = encoding; }

  std::size_t left() const { return m_rest.size(); }  ///< bytes
  std::string_view line();                            ///< without its end; empty at the end
  std::string_view word();  ///< between white space, across lines; empty at the end
  std::string_view take(std::size_t bytes);
  double number(NumberType type);
  std::vector<double> numbers(NumberType type, std::size_t count);
  std::int64_t integer(NumberType type);
  std::size_t count(std::size_t most);  ///< a word; so many can be stored

 private:
  std::string_view m_rest;
  Encoding m_encoding;
};

double toNumber(std::string_view word);        ///< FileFault if it is none
bool isCount(double value, std::size_t most);  ///< whole, from 0 on

}  // namespace palpate::vtk
