#pragma once

#include "MeshFiles/FileText.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>

namespace palpate::files {

/// The content of a file that is being written. Numbers are the shortest decimals that give the
/// same value, or bytes.
class Output {
 public:
  explicit Output(Encoding encoding) : m_encoding(encoding) {}

  bool isText() const { return m_encoding == Encoding::Text; }
  Output& text(std::string_view words) {
    m_content += words;
    return *this;
  }
  template <class T>
  Output& decimal(T value) {
    std::array<char, 32> digits;
    const auto [end, fault] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
    return text({digits.data(), end});
  }
  /// Text, followed by a space, or bytes of the type T.
  template <class T>
  Output& number(T value) {
    if (isText()) return decimal(value).text(" ");
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), &value, sizeof value);
    if ((m_encoding == Encoding::BigEndian) != (std::endian::native == std::endian::big))
      std::reverse(bytes.begin(), bytes.end());
    return text({bytes.data(), bytes.size()});
  }
  template <class T, class Numbers>
  Output& numbers(const Numbers& values) {
    for (const auto value : values) number(static_cast<T>(value));
    return *this;
  }
  /// Of text only: replaces the last space.
  Output& endLine() {
    if (isText() && !m_content.empty() && m_content.back() == ' ') m_content.pop_back();
    return isText() ? text("\n") : *this;
  }
  std::size_t size() const { return m_content.size(); }
  std::string take() { return std::move(m_content); }

 private:
  std::string m_content;
  Encoding m_encoding;
};

}  // namespace palpate::files
