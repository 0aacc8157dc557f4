#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <utility>

namespace palpate {

/// The last part of the text by which the compiler names a value of an enumeration: "Auto" in
/// "palpate::Method::Auto"; "Method)6" in "(palpate::Method)6" for a value without an enumerator.
template <auto value>
constexpr std::string_view compilersNameOf() {
  constexpr std::string_view kBefore = "value = ";
  std::string_view text = __PRETTY_FUNCTION__;
  text.remove_prefix(text.find(kBefore) + kBefore.size());
  text = text.substr(0, text.find_first_of(";]"));
  return text.substr(text.find_last_of(':') + 1);
}

/// g++ leaves out the namespace of the function where it names a type, so that the function has one
/// of its own.
namespace compiler {
template <class Type>
constexpr std::string_view textOf() {
  return __PRETTY_FUNCTION__;
}
}  // namespace compiler

/// The name of a type of this library by which the compiler knows it, as "ContactFeatures::Kind".
template <class Type>
constexpr std::string_view nameOfType() {
  constexpr std::string_view kBefore = "Type = palpate::";
  std::string_view text = compiler::textOf<Type>();
  const std::size_t begin = text.find(kBefore);
  if (begin == text.npos) return {};
  text.remove_prefix(begin + kBefore.size());
  return text.substr(0, text.find_first_of(";]"));
}

/// The name of an enumerator, with a null character behind it. Hidden, as the library would export
/// variables whose arguments are visible.
template <auto value>
[[gnu::visibility("hidden")]] inline constexpr auto kEnumerator = [] {
  constexpr std::string_view kName = compilersNameOf<value>();
  std::array<char, kName.size() + 1> text{};
  std::copy(kName.begin(), kName.end(), text.begin());
  return text;
}();

/// The number of enumerators, which count from 0.
template <class Enumeration, std::size_t count = 0>
constexpr std::size_t countEnumerators() {
  constexpr std::string_view kName = compilersNameOf<static_cast<Enumeration>(count)>();
  if constexpr (kName.find(')') != kName.npos)
    return count;
  else
    return countEnumerators<Enumeration, count + 1>();
}

template <class Enumeration, std::size_t... values>
constexpr std::array<std::string_view, sizeof...(values)> namesOfEnumerators(
    std::index_sequence<values...>) {
  return {kEnumerator<static_cast<Enumeration>(values)>.data()...};
}

/// The names of all enumerators, in the order of their values. An id has none.
template <class Enumeration>
[[gnu::visibility("hidden")]] inline constexpr auto kEnumerators =
    namesOfEnumerators<Enumeration>(std::make_index_sequence<countEnumerators<Enumeration>()>());

/// The name of a value, or "unknown".
template <class Enumeration>
constexpr const char* nameOfEnumerator(Enumeration value) {
  const auto place = static_cast<std::size_t>(value);
  return place < kEnumerators<Enumeration>.size() ? kEnumerators<Enumeration>[place].data()
                                                  : "unknown";
}

}  // namespace palpate
