#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace palpate::files {

/// Why a file is refused: the part of the message after the file's name.
struct FileFault {
  std::string reason;
};

enum class Encoding { Text, LittleEndian, BigEndian };

struct NumberType {
  std::size_t size;  ///< bytes
  double (*decode)(const char* bytes);
};

/// A number as messages show it: a whole number, or the shortest decimal of the same double.
std::string shortest(double);

/// Reads a file's content, or what is encoded in a part of it, from front to back. Faults are
/// thrown as FileFault with the line (text) or the byte (binary) of what was read last.
class FileText {
 public:
  explicit FileText(std::string_view file)
      : m_file(file), m_rest(file), m_last(file.data()), m_origin(nullptr) {}
  /// Reads a part of the text.
  FileText part(std::string_view text) const;
  /// Reads bytes that are stored in the file at `origin` in another form.
  FileText decoded(std::string_view bytes, Encoding encoding, const char* origin) const;

  void setEncoding(Encoding encoding) { m_encoding = encoding; }
  Encoding encoding() const { return m_encoding; }
  bool isText() const { return m_encoding == Encoding::Text; }

  std::string_view rest() const { return m_rest; }
  std::size_t left() const { return m_rest.size(); }  ///< bytes
  std::string_view line();     ///< without its end; empty at the end of the file
  std::string_view word();     ///< between white space, across lines; empty at the end
  std::string_view keyword();  ///< a word that must be there
  std::string_view take(std::size_t bytes);
  void expectWord(std::string_view);  ///< reads this word, or refuses the file

  /// The type that any of the formats calls by this name. Refuses unknown ones.
  NumberType typeNamed(std::string_view name) const;
  double number();                   ///< text
  double number(const NumberType&);  ///< text, or binary of this type
  void skip(const NumberType&, std::size_t count);
  std::int64_t whole(std::size_t bytes = 8);  ///< text, or a signed binary integer of 4 or 8 bytes
  /// A whole number of items, each of which takes at least `size` bytes of what is left.
  std::size_t count(const char* items, std::size_t size, std::size_t bytes = 8);
  /// The same for a number that was read.
  std::size_t asCount(double number, const char* items, std::size_t size) const;
  void checkCount(std::size_t count, const char* items, std::size_t size) const;

  [[noreturn]] void refuse(const std::string& reason) const;
  /// Expects something else than the word, which is empty at the end.
  [[noreturn]] void refuseWord(std::string_view expected, std::string_view word) const;

 private:
  std::string_view m_file, m_rest;
  const char* m_last;    ///< the start of what was read last
  const char* m_origin;  ///< of decoded bytes, in the file
  Encoding m_encoding = Encoding::Text;
};

}  // namespace palpate::files
