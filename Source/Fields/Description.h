#pragma once

#include "Fields/Fields.h"
#include "Fields/Names.h"
#include "Core/Archive.h"
#include "Core/Assert.h"

#include <cstddef>
#include <type_traits>

/// Archives of what Fields lists.
namespace palpate::description {

template <class File>
inline constexpr bool kIsArchive =
    std::is_same_v<File, ArchiveWriter> || std::is_same_v<File, ArchiveReader>;

/// Bytes that valueOf() writes at least.
template <class Value>
constexpr std::size_t leastBytes() {
  if constexpr (HasFields<Value>) {
    return Fields<Value>::kList([]<class... Members>(const Field<Value, Members>&...) {
      return (leastBytes<Members>() + ...);
    });
  } else if constexpr (std::is_enum_v<Value>) {
    return kEnumerators<Value>.empty() ? sizeof(Value) : 1;
  } else if constexpr (std::is_same_v<Value, bool> || requires(Value v) { v.has_value(); }) {
    return sizeof(int);
  } else if constexpr (requires(Value v) { v.capacity(); }) {
    return sizeof(std::uint64_t);
  } else {
    return sizeof(Value);
  }
}

/// Writes or reads a value: a struct by its members, or a list, an optional value, an enumerator or
/// a number.
template <class File>
void valueOf(File& file, auto& value) {
  using Value = std::remove_cvref_t<decltype(value)>;
  const auto each = [&](auto& part) { valueOf(file, part); };
  if constexpr (HasFields<Value>) {
    forEachMember(value, [&](const auto&, auto& member) { valueOf(file, member); });
  } else if constexpr (std::is_enum_v<Value>) {
    if constexpr (kEnumerators<Value>.empty()) {
      file.integer(value);
    } else {
      PALPATE_ASSERT(File::kReads || static_cast<std::size_t>(value) < kEnumerators<Value>.size());
      file.word(value, kEnumerators<Value>);
    }
  } else if constexpr (requires { value.has_value(); }) {
    optionalOf(file, value, each);
  } else if constexpr (requires { value.capacity(); }) {
    itemsOf(file, value, leastBytes<typename Value::value_type>(), each);
  } else {
    fieldOf(file, value);
  }
}

}  // namespace palpate::description
