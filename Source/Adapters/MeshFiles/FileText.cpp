#include "MeshFiles/FileText.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace palpate::files {

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

constexpr std::pair<std::string_view, NumberType> kNumberTypes[]{
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

/// A short form of a word for messages.
std::string quoted(std::string_view word) {
  std::string text(word.substr(0, 40));
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return "\"" + text + (word.size() > 40 ? "...\"" : "\"");
}

std::string_view withoutPlus(std::string_view word) {
  return word.substr(word.starts_with('+') && !word.starts_with("+-"));
}

/// A word's number; nothing else may be in the word.
template <class T>
bool parse(std::string_view word, T& value) {
  const std::string_view digits = withoutPlus(word);
  const auto [end, fault] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (fault == std::errc::invalid_argument || end != digits.data() + digits.size()) return false;
  // For numbers out of range from_chars does not set the value. Tiny ones count as zero.
  if (fault == std::errc::result_out_of_range)
    value = digits.rfind('-') + 1 > 1 ? T{0} : std::numeric_limits<T>::infinity();
  return true;
}
template <>
bool parse(std::string_view word, std::int64_t& value) {
  const std::string_view digits = withoutPlus(word);
  const auto [end, fault] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  return fault == std::errc() && end == digits.data() + digits.size();
}

}  // namespace

std::string shortest(double value) {
  if (value == std::floor(value) && std::abs(value) < 0x1p53)
    return std::to_string(static_cast<std::int64_t>(value));
  std::array<char, 32> text;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

FileText FileText::part(std::string_view text) const {
  FileText part = *this;
  part.m_rest = text;
  part.m_last = text.data();
  return part;
}

FileText FileText::decoded(std::string_view bytes, Encoding encoding, const char* origin) const {
  FileText other = *this;
  other.m_rest = bytes;
  other.m_origin = origin;
  other.m_encoding = encoding;
  return other;
}

void FileText::refuse(const std::string& reason) const {
  const char* const at = m_origin ? m_origin : m_last;
  const auto offset = static_cast<std::size_t>(at - m_file.data());
  if (!isText()) throw FileFault{"byte " + std::to_string(offset) + ": " + reason};
  const auto lines = std::count(m_file.begin(), m_file.begin() + (at - m_file.data()), '\n');
  throw FileFault{"line " + std::to_string(lines + 1) + ": " + reason};
}

void FileText::refuseWord(std::string_view expected, std::string_view word) const {
  refuse("expected " + std::string(expected) +
         (word.empty() ? ", but this is the end" : ", not " + quoted(word)));
}

std::string_view FileText::line() {
  m_last = m_rest.data();
  const std::size_t end = m_rest.find('\n');
  std::string_view text = m_rest.substr(0, end);
  m_rest.remove_prefix(end == m_rest.npos ? m_rest.size() : end + 1);
  if (text.ends_with('\r')) text.remove_suffix(1);
  return text;
}

std::string_view FileText::word() {
  const auto begin = std::find_if_not(m_rest.begin(), m_rest.end(), isSpace);
  const auto end = std::find_if(begin, m_rest.end(), isSpace);
  m_rest.remove_prefix(static_cast<std::size_t>(begin - m_rest.begin()));
  m_last = m_rest.data();
  const std::string_view word = m_rest.substr(0, static_cast<std::size_t>(end - begin));
  m_rest.remove_prefix(word.size());
  return word;
}

std::string_view FileText::keyword() {
  const std::string_view text = word();
  if (text.empty()) refuseWord("a word", text);
  return text;
}

std::string_view FileText::take(std::size_t bytes) {
  m_last = m_rest.data();
  if (m_rest.size() < bytes)
    refuse("expected " + std::to_string(bytes) + " bytes, but only " +
           std::to_string(m_rest.size()) + " are left: it is truncated");
  const std::string_view taken = m_rest.substr(0, bytes);
  m_rest.remove_prefix(bytes);
  return taken;
}

void FileText::expectWord(std::string_view expected) {
  if (const std::string_view text = word(); text != expected) refuseWord(expected, text);
}

NumberType FileText::typeNamed(std::string_view name) const {
  const std::string word = std::string(1, ' ').append(name).append(1, ' ');
  for (const auto& [names, type] : kNumberTypes)
    if (word.size() > 2 && names.find(word) != names.npos) return type;
  refuseWord("the type of numbers", name);
}

double FileText::number() {
  const std::string_view text = word();
  double value = 0;
  if (!parse(text, value)) refuseWord("a number", text);
  return value;
}

double FileText::number(const NumberType& type) {
  if (isText()) return number();
  char bytes[8];
  take(type.size).copy(bytes, type.size);
  if ((m_encoding == Encoding::BigEndian) != (std::endian::native == std::endian::big))
    std::reverse(bytes, bytes + type.size);
  return type.decode(bytes);
}

void FileText::skip(const NumberType& type, std::size_t count) {
  checkCount(count, "numbers", isText() ? 2 : type.size);
  if (!isText()) take(count * type.size);
  for (std::size_t i = isText() ? 0 : count; i < count; ++i) number();
}

std::int64_t FileText::whole(std::size_t bytes) {
  if (isText()) {
    const std::string_view text = word();
    std::int64_t value = 0;
    if (!parse(text, value)) refuseWord("a whole number", text);
    return value;
  }
  // Through an integer of the same size: a double would round large ones.
  std::string stored(take(bytes));
  if ((m_encoding == Encoding::BigEndian) != (std::endian::native == std::endian::big))
    std::reverse(stored.begin(), stored.end());
  std::int32_t narrow = 0;
  std::int64_t wide = 0;
  std::memcpy(bytes == 4 ? static_cast<void*>(&narrow) : &wide, stored.data(), bytes);
  return bytes == 4 ? narrow : wide;
}

void FileText::checkCount(std::size_t count, const char* items, std::size_t size) const {
  if (const std::size_t most = (left() + 1) / size; count > most)  // text may end with its file
    refuse("expected at most " + std::to_string(most) + " " + items + " in the " +
           std::to_string(left()) + " bytes that are left, not " + std::to_string(count));
}

std::size_t FileText::count(const char* items, std::size_t size, std::size_t bytes) {
  const std::int64_t value = whole(bytes);
  if (value < 0)
    refuse("expected the number of " + std::string(items) + ", not " + std::to_string(value));
  checkCount(static_cast<std::size_t>(value), items, size);
  return static_cast<std::size_t>(value);
}

std::size_t FileText::asCount(double number, const char* items, std::size_t size) const {
  if (!(number >= 0 && number == std::floor(number) && number < 0x1p53))  // refuses NaN
    refuse("expected the number of " + std::string(items) + ", not " + shortest(number));
  checkCount(static_cast<std::size_t>(number), items, size);
  return static_cast<std::size_t>(number);
}

}  // namespace palpate::files
