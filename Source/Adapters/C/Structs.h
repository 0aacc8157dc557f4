#pragma once

#include "C/Twins.h"
#include "Fields/Fields.h"
#include "Fields/Names.h"

#include <array>
#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace palpate::c {

// Some structs of C are no twins: they begin with `size`, and then have the members of the C++
// struct, those of larger alignment first, else in the same order. Flags and enumerators are
// numbers and lists are views. The members of a struct that C has not, such as OctreeSettings,
// stand in its place.

/// Whether the members of a member stand in its place.
template <class Member>
inline constexpr bool kIsTakenApart = HasFields<Member>&& std::is_same_v<InCOf<Member>, Member>;

/// Bytes of the members of a struct of C, by their alignment.
template <class Struct>
constexpr std::array<std::size_t, 9> bytesInC() {
  std::array<std::size_t, 9> bytes{};
  const auto add = [&]<class Member, bool isInC>(const Field<Struct, Member, isInC>&) {
    if constexpr (isInC && kIsTakenApart<Member>)
      for (std::size_t i = 0; const std::size_t each : bytesInC<Member>()) bytes[i++] += each;
    else if constexpr (isInC)
      bytes[alignof(InCOf<Member>)] += sizeof(InCOf<Member>);
  };
  Fields<Struct>::kList([&](const auto&... fields) { (add(fields), ...); });
  return bytes;
}

/// The places in a struct of C of the next members of each alignment. There are no gaps.
template <class C, class Struct>
class Places {
 public:
  template <class Member>
  std::size_t next() {
    return std::exchange(m_next[alignof(Member)], m_next[alignof(Member)] + sizeof(Member));
  }

 private:
  static constexpr std::array<std::size_t, 9> kBytes = bytesInC<Struct>();
  static constexpr std::size_t kFirst4 = sizeof(C::size) + kBytes[8], kFirst1 = kFirst4 + kBytes[4];
  static_assert(offsetof(C, size) == 0 &&
                    (kFirst1 + kBytes[1] + alignof(C) - 1) / alignof(C) * alignof(C) == sizeof(C),
                "C has other members");
  std::array<std::size_t, 9> m_next{0, kFirst1, 0, 0, kFirst4, 0, 0, 0, sizeof(C::size)};
};

/// Calls function(member, name, name of the outer member or null) for the members that C has.
template <class Struct, class Function>
void forEachInC(Struct& object, const Function& function, const char* outer = nullptr) {
  forEachMember(object, [&](const auto& field, auto& member) {
    using Member = std::remove_cvref_t<decltype(member)>;
    if constexpr (!std::remove_cvref_t<decltype(field)>::kIsInC)
      return;
    else if constexpr (kIsTakenApart<Member>)
      forEachInC(member, function, field.name);
    else
      function(member, field.name, outer);
  });
}

template <class Member>
InCOf<Member> inC(const Member& value) {
  if constexpr (std::is_same_v<InCOf<Member>, palpate_indices>)
    return {value.data(), value.size()};
  else if constexpr (std::is_class_v<Member>)
    return fromTwin<InCOf<Member>>(value);
  else
    return static_cast<InCOf<Member>>(value);
}

template <class C, class Struct>
C structOf(const Struct& object) {
  C result{};
  result.size = sizeof result;
  Places<C, Struct> places;
  forEachInC(object, [&](const auto& member, const char*, const char*) {
    const auto value = inC(member);
    std::memcpy(reinterpret_cast<char*>(&result) +
                    places.template next<std::remove_const_t<decltype(value)>>(),
                &value, sizeof value);
  });
  return result;
}

/// The settings of the caller, or the defaults for null. name: in messages.
template <class Struct, class C>
Struct structFrom(const C* settings, const char* name = "the settings") {
  Struct object;
  if (!settings) return object;
  const char* const from = reinterpret_cast<const char*>(&sized(settings, name));
  Places<C, Struct> places;
  forEachInC(object, [&](auto& member, const char* inner, const char* outer) {
    using Member = std::remove_reference_t<decltype(member)>;
    InCOf<Member> value;
    std::memcpy(&value, from + places.template next<InCOf<Member>>(), sizeof value);
    if constexpr (std::is_enum_v<Member>)
      member = enumerator(value, static_cast<Member>(kEnumerators<Member>.size() - 1),
                          (outer ? outer + std::string("_") : "") + inner);
    else if constexpr (std::is_same_v<Member, bool>)
      member = value != 0;
    else
      member = value;
  });
  return object;
}

template <class Struct, class C>
palpate_status initialiseAs(const char* function, C* data, std::size_t size) noexcept {
  return initialise(function, data, size, structOf<C>(Struct()));
}

}  // namespace palpate::c
