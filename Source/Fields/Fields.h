#pragma once

#include <concepts>
#include <cstdint>
#include <type_traits>

namespace palpate {

/// The unit of the numbers in a member.
enum class Unit : std::uint8_t {
  None,
  Length,        ///< L
  Direction,     ///< a unit vector
  StepFraction,  ///< [0, 1] of the step
  Steps,
  Detections,
  Angle,  ///< rad
  Milliseconds,
  Bytes
};

/// A member of a public struct. isInC: the C interface has it.
template <class Struct, class Member, bool isInC = true>
struct Field {
  static constexpr bool kIsInC = isInC;
  const char* name;
  Member Struct::*member;
  Unit unit;
};

template <class Struct, class Member>
constexpr Field<Struct, Member> field(const char* name, Member Struct::*member,
                                      Unit unit = Unit::None) {
  return {name, member, unit};
}
template <class Struct, class Member>
constexpr Field<Struct, Member, false> notInC(const Field<Struct, Member>& field) {
  return {field.name, field.member, field.unit};
}

/// A value that initialises only members of this type.
template <class Member>
struct ValueFor {
  template <std::same_as<Member> Wanted>
  operator Wanted() const;
};

/// Whether the first members of an aggregate have these types.
template <class Struct, class... Members>
inline constexpr bool kBeginsWith = requires {
  Struct{ValueFor<Members>{}...};
};

/// Whether the aggregate has one more member.
template <class Struct, class... Members>
inline constexpr bool kHasMoreThan = requires {
  Struct{ValueFor<Members>{}..., {}};
};

/// All members of a struct: a function that calls another one with the fields. It costs the
/// compiler less than a std::tuple.
template <class Struct, class... Members, bool... isInC>
constexpr auto listOf(Field<Struct, Members, isInC>... fields) {
  static_assert(kBeginsWith<Struct, Members...> && !kHasMoreThan<Struct, Members...>,
                "the list must have all members in the order of the struct");
  return [=](auto&& function) -> decltype(auto) { return function(fields...); };
}

/// A name in the style of C and Python: "time_of_impact" for "timeOfImpact".
struct SnakeCase {
  char text[40] = {};
};
constexpr SnakeCase snakeCase(const char* name) {
  SnakeCase result;
  for (char* out = result.text; *name; ++name) {
    const bool isUpper = 'A' <= *name && *name <= 'Z';
    if (isUpper) *out++ = '_';
    *out++ = static_cast<char>(isUpper ? *name - 'A' + 'a' : *name);
  }
  return result;
}

/// The list of the members of a public struct: `kList`, in the order of their declaration. The
/// headers of this folder have those of the public headers.
template <class Struct>
struct Fields {};

template <class Struct>
concept HasFields = requires {
  Fields<Struct>::kList;
};

/// Calls function(field, member) for each member.
template <class Struct, class Function>
void forEachMember(Struct& object, Function&& function) {
  Fields<std::remove_const_t<Struct>>::kList(
      [&](const auto&... fields) { (function(fields, object.*fields.member), ...); });
}

}  // namespace palpate
