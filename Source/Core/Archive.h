#pragma once

#include "Core/Assert.h"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace palpate {

static_assert(std::endian::native == std::endian::little, "archives hold numbers as memory does");

/// Writes the numbers of a description as bytes.
class ArchiveWriter {
 public:
  static constexpr bool kReads = false;

  /// expectedSize: bytes. A close one spares copies.
  ArchiveWriter(std::string_view title, std::uint32_t version, std::size_t expectedSize = 0);
  template <class Number>
  void integer(Number value) {
    static_assert(std::is_arithmetic_v<Number> || std::is_enum_v<Number>);
    append(&value, sizeof value);
  }
  void real(double value) { append(&value, sizeof value); }
  /// The same as each of them.
  template <class Number>
  void numbers(std::span<const Number> values) requires(std::is_arithmetic_v<Number> &&
                                                        !std::is_same_v<Number, bool>) {
    append(values.data(), values.size_bytes());
  }
  template <class Enumerator, std::size_t size>
  void word(Enumerator value, const std::array<std::string_view, size>&) {
    integer(static_cast<std::uint8_t>(value));
  }
  void count(std::size_t value, std::size_t = 0) { integer(std::uint64_t{value}); }
  void expect(std::string_view) {}  // only texts need words
  void endLine() {}
  std::size_t size() const { return m_size; }
  /// With a checksum behind them. Call it last.
  std::vector<std::byte> bytes();

 private:
  void append(const void* from, std::size_t size) {
    if (size == 0) return;
    if (m_bytes.size() - m_size < size) m_bytes.resize(2 * m_bytes.size() + size);
    std::memcpy(m_bytes.data() + m_size, from, size);
    m_size += size;
  }
  std::vector<std::byte> m_bytes;
  std::size_t m_size = 0;
};

/// Reads such bytes. Throws Error (ErrorCode::File) that names the byte.
class ArchiveReader {
 public:
  static constexpr bool kReads = true;

  /// Checks title, version and checksum. name: the start of messages, such as "the saved state".
  ArchiveReader(std::span<const std::byte>, std::string name, std::string_view title,
                std::uint32_t version);
  template <class Number>
  void integer(Number& value) {
    static_assert(std::is_arithmetic_v<Number> || std::is_enum_v<Number>);
    take(&value, sizeof value);
  }
  void real(double& value) {
    take(&value, sizeof value);
    need(value == value, "a number is NaN");
  }
  template <class Enumerator, std::size_t size>
  void word(Enumerator& value, const std::array<std::string_view, size>&) {
    std::uint8_t place = 0;
    integer(place);
    need(place < size, "there is no such enumerator");
    value = static_cast<Enumerator>(place);
  }
  /// Reads the number of items that follow. least: bytes of an item, at least 1.
  void count(std::size_t& value, std::size_t least) {
    std::uint64_t number = 0;
    integer(number);
    need(number <= (m_bytes.size() - m_at) / least, "it is truncated");
    value = static_cast<std::size_t>(number);
  }
  void expect(std::string_view) {}
  void endLine() {}
  void expectEnd() const { need(m_at == m_bytes.size(), "there are bytes after the end"); }
  void need(bool isGood, const char* reason) const {
    if (!isGood) fail(reason);
  }
  [[noreturn]] void fail(const std::string& reason) const;

 private:
  void take(void* to, std::size_t size) {
    need(size <= m_bytes.size() - m_at, "it is truncated");
    std::memcpy(to, m_bytes.data() + m_at, size);
    m_at += size;
  }
  std::span<const std::byte> m_bytes;
  std::string m_name;
  std::size_t m_at = 0;
};

/// Of all bytes of an archive but the last eight, where it stands.
std::uint64_t archiveChecksum(std::span<const std::byte>);

/// A description is a function that writes a value to a file or reads it, so that both cannot
/// differ. `file` is a writer or a reader; File::kReads says which.
namespace description {

template <class File>
void fieldOf(File& file, auto& value) {
  using Value = std::decay_t<decltype(value)>;
  if constexpr (std::is_same_v<Value, double>) {
    file.real(value);
  } else if constexpr (std::is_same_v<Value, bool>) {
    int number = 0;
    if constexpr (!File::kReads) number = value;  // a value to be read has none yet
    file.integer(number);
    if constexpr (File::kReads) value = number != 0;
  } else if constexpr (std::is_integral_v<Value>) {
    file.integer(value);
  } else if constexpr (requires { file.numbers(std::span(std::as_const(value).data(), 1)); }) {
    file.numbers(std::span(std::as_const(value).data(), static_cast<std::size_t>(value.size())));
  } else {
    for (auto& part : value) fieldOf(file, part);
  }
}

/// The size of a list. A reader resizes the list to it. least: characters or bytes of an item.
template <class File>
void sizeOf(File& file, auto& list, std::size_t least) {
  std::size_t size = list.size();
  file.count(size, least);
  if constexpr (File::kReads) list.resize(size);
}

/// The functions below are for archives only. An enumerator, of which `last` is the last one.
template <class File, class Enumerator>
void enumeratorOf(File& file, Enumerator& value, std::type_identity_t<Enumerator> last) {
  auto number = static_cast<std::uint8_t>(value);
  file.integer(number);
  if constexpr (File::kReads) {
    file.need(number <= static_cast<std::uint8_t>(last), "there is no such enumerator");
    value = static_cast<Enumerator>(number);
  }
}

/// A value that there may be: one of std::optional, or made by `new`.
template <class File, class Optional, class F>
void optionalOf(File& file, Optional& value, F&& describe) {
  bool isThere = static_cast<bool>(value);
  fieldOf(file, isThere);
  if (!isThere) return;
  if constexpr (File::kReads) {
    if constexpr (requires { value.emplace(); })
      value.emplace();
    else
      value = std::make_unique<typename Optional::element_type>();
  }
  describe(*value);
}

template <class File, class F>
void itemsOf(File& file, auto& list, std::size_t least, F&& describe) {
  sizeOf(file, list, least);
  if constexpr (File::kReads) {
    for (auto& item : list) describe(item);
  } else {
    [[maybe_unused]] const std::size_t begin = file.size();  // of an assertion
    for (auto& item : list) describe(item);
    // A reader refuses more items than fit into the rest.
    PALPATE_ASSERT(file.size() - begin >= least * list.size());
  }
}

/// A DerivedFrom, by the description of its state.
template <class File, class F>
void derivedOf(File& file, auto& derived, F&& describe) {
  bool isValid = derived.isValid();
  auto state = derived.state();
  fieldOf(file, isValid);
  describe(state);
  if constexpr (File::kReads) {
    derived.commit(state);
    if (!isValid) derived.invalidate();
  }
}

}  // namespace description

}  // namespace palpate
