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

template <class T>
double decode(const char* bytes) {
  T number;
  std::memcpy(&number, bytes, sizeof number);
  return static_cast<double>(number);
}

template <class T>
constexpr NumberType kType{sizeof(T), decode<T>};

constexpr std::pair<std::string_view, NumberType> kTypes[]{
    {" Int8 int8 char signed_char ", kType<std::int8_t>},
    {" UInt8 uint8 uchar unsigned_char ", kType<std::uint8_t>},
    {" Int16 int16 short ", kType<std::int16_t>},
    {" UInt16 uint16 ushort unsigned_short ", kType<std::uint16_t>},
    {" Int32 int32 int vtkIdType vtkidtype ", kType<std::int32_t>},
    {" UInt32 uint32 uint unsigned_int ", kType<std::uint32_t>},
    {" Int64 vtktypeint64 long ", kType<std::int64_t>},
    {" UInt64 vtktypeuint64 unsigned_long ", kType<std::uint64_t>},
    {" Float32 float32 float ", kType<float>},
    {" Float64 float64 double ", kType<double>}};

}  // namespace

NumberType typeNamed(std::string_view name) {
  const std::string word = std::string(1, ' ').append(name).append(1, ' ');
  for (const auto& [names, type] : kTypes)
    if (names.find(word) != names.npos) return type;
  throw FileFault{"it has the unknown number type \"" + std::string(name.substr(0, 40)) + "\""};
}

double toNumber(std::string_view word) {
  if (word.empty()) throw FileFault{"a number is missing at the end"};
  const std::string_view digits = word.substr(word[0] == '+');
  double value = 0;
  const auto [end, fault] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (fault == std::errc::invalid_argument || end != digits.data() + digits.size())
    throw FileFault{"\"" + std::string(word.substr(0, 40)) + "\" is not a number"};
  // For numbers out of double's range from_chars does not set the value. Tiny ones count as zero.
  if (fault == std::errc::result_out_of_range) return digits.rfind('-') + 1 > 1 ? 0.0 : HUGE_VAL;
  return value;
}

std::size_t toCount(double number, std::size_t most) {  // refuses NaN
  if (number > static_cast<double>(most)) throw FileFault{"it is shorter than its counts require"};
  if (!(number >= 0 && number == std::floor(number)))
    throw FileFault{"one of its counts is not a whole number, or is negative"};
  return static_cast<std::size_t>(number);
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
  m_rest.remove_prefix(static_cast<std::size_t>(end - m_rest.begin()));
  return {begin, end};
}

std::string_view FileText::take(std::size_t bytes) {
  if (m_rest.size() < bytes) throw FileFault{"it is truncated"};
  const std::string_view taken = m_rest.substr(0, bytes);
  m_rest.remove_prefix(bytes);
  return taken;
}

double FileText::number(NumberType type) {
  if (m_encoding == Encoding::Ascii) return toNumber(word());
  char bytes[8];
  take(type.size).copy(bytes, type.size);
  if ((m_encoding == Encoding::BigEndian) != (std::endian::native == std::endian::big))
    std::reverse(bytes, bytes + type.size);
  return type.decode(bytes);
}

std::vector<double> FileText::numbers(NumberType type, std::size_t count) {
  std::vector<double> result(toCount(static_cast<double>(count), left()));
  for (double& value : result) value = number(type);
  return result;
}

}  // namespace palpate::vtk
