#include "Vtk/FileText.h"

#include "Vtk/MeshFile.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>

namespace palpate::vtk {

namespace {

bool isSpace(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

}  // namespace

std::size_t sizeOf(NumberType type) {
  switch (type) {
    case NumberType::Int8:
    case NumberType::UInt8:
      return 1;
    case NumberType::Int16:
    case NumberType::UInt16:
      return 2;
    case NumberType::Int32:
    case NumberType::UInt32:
    case NumberType::Float32:
      return 4;
    default:
      return 8;
  }
}

double toNumber(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  double value = 0;
  const auto [end, fault] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (fault == std::errc::invalid_argument || end != word.data() + word.size()) {
    throw FileFault{"\"" + std::string(word.substr(0, 40)) + "\" stands where a number should"};
  }
  // Out of double's range: from_chars leaves the value alone. Tiny ones are zero for any mesh.
  if (fault == std::errc::result_out_of_range)
    return word.find('-', 1) != word.npos ? 0.0 : HUGE_VAL;
  return value;
}

std::string_view FileText::line() {
  const std::size_t end = m_rest.find('\n');
  std::string_view text = m_rest.substr(0, end);
  m_rest.remove_prefix(end == m_rest.npos ? m_rest.size() : end + 1);
  if (text.ends_with('\r')) text.remove_suffix(1);
  return text;
}

std::string_view FileText::word() {
  const auto begin = std::find_if_not(m_rest.begin(), m_rest.end(), isSpace);
  const auto end = std::find_if(begin, m_rest.end(), isSpace);
  const std::string_view text(begin, end);
  m_rest.remove_prefix(end - m_rest.begin());
  return text;
}

namespace {

template <class T>
double value(std::array<char, 8> bytes) {
  T number;
  std::memcpy(&number, bytes.data(), sizeof number);
  return static_cast<double>(number);
}

double decode(NumberType type, std::array<char, 8> bytes) {
  switch (type) {
    case NumberType::Int8:
      return value<std::int8_t>(bytes);
    case NumberType::UInt8:
      return value<std::uint8_t>(bytes);
    case NumberType::Int16:
      return value<std::int16_t>(bytes);
    case NumberType::UInt16:
      return value<std::uint16_t>(bytes);
    case NumberType::Int32:
      return value<std::int32_t>(bytes);
    case NumberType::UInt32:
      return value<std::uint32_t>(bytes);
    case NumberType::Int64:
      return value<std::int64_t>(bytes);
    case NumberType::UInt64:
      return value<std::uint64_t>(bytes);
    case NumberType::Float32:
      return value<float>(bytes);
    default:
      return value<double>(bytes);
  }
}

}  // namespace

std::string_view FileText::take(std::size_t bytes) {
  if (m_rest.size() < bytes) throw FileFault{"it ends too early"};
  const std::string_view taken = m_rest.substr(0, bytes);
  m_rest.remove_prefix(bytes);
  return taken;
}

double FileText::number(NumberType type, Encoding encoding) {
  if (encoding == Encoding::Ascii) {
    const std::string_view text = word();
    if (text.empty()) throw FileFault{"a number is missing at the end"};
    return toNumber(text);
  }
  const std::size_t size = sizeOf(type);
  const std::string_view source = take(size);
  std::array<char, 8> bytes{};
  std::copy(source.begin(), source.end(), bytes.begin());
  const bool swapped =
      (encoding == Encoding::BigEndian) != (std::endian::native == std::endian::big);
  if (swapped) std::reverse(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
  return decode(type, bytes);
}

std::int64_t FileText::integer(NumberType type, Encoding encoding) {
  const double value = number(type, encoding);
  // NaN fails the comparison too; every whole number below 2^53 is a double.
  if (value != std::floor(value) || !(std::abs(value) < 0x1p53)) {
    throw FileFault{"a count or an index is no whole number"};
  }
  return static_cast<std::int64_t>(value);
}

std::size_t FileText::count() {
  const std::int64_t value = integer(NumberType::Int64, Encoding::Ascii);
  if (value < 0) throw FileFault{"one of its counts is negative"};
  if (static_cast<std::uint64_t>(value) > m_rest.size())
    throw FileFault{"it is shorter than its own counts say"};
  return static_cast<std::size_t>(value);
}

std::string fromBase64(std::string_view text) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  std::uint32_t group = 0;
  int digits = 0, padding = 0;
  for (const char c : text) {
    if (isSpace(c)) continue;
    const std::size_t digit = c == '=' ? 0 : kDigits.find(c);
    if (digit == kDigits.npos) break;
    padding += c == '=';
    group = group << 6 | static_cast<std::uint32_t>(digit);
    if (++digits < 4) continue;
    for (int byte = 2; byte >= padding; --byte)
      bytes += static_cast<char>(group >> 8 * byte & 0xff);
    group = 0;
    digits = padding = 0;
  }
  return bytes;
}

}  // namespace palpate::vtk
