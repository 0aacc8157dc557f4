#pragma once

#include "Python/Arrays.h"

#include <type_traits>
#include <tuple>

namespace palpate::python {

/// A member of a struct, with its name in Python. Member: a pointer to it, or a function that takes
/// the struct and returns a reference.
template <class Member>
struct Field {
  const char* name;
  Member member;
};
template <class Member>
constexpr Field<Member> field(const char* name, Member member) {
  return {name, member};
}

/// The members of a struct that Python sees, as a tuple of Field. Records.h and Classes.h list
/// them.
template <class Struct>
inline constexpr auto kFields = nullptr;

template <class Struct>
concept HasFields = !std::is_same_v<decltype(kFields<Struct>), const std::nullptr_t>;

/// Calls f(name, member) for each field of the struct.
template <class Struct, class F>
void forEachField(Struct& object, F&& f) {
  std::apply(
      [&](const auto&... fields) { (f(fields.name, std::invoke(fields.member, object)), ...); },
      kFields<std::remove_const_t<Struct>>);
}

/// An object of one of the package's Python modules, such as a class. It is looked up once for each
/// tag, so that a tag stands for one object.
template <class Tag>
py::handle lookedUp(const char* module, const char* name) {
  static PyObject* object = nullptr;  // guarded by the GIL; a guard of C++ could wait for it
  if (object == nullptr) object = py::getattr(py::module_::import(module), name).release().ptr();
  return object;
}

}  // namespace palpate::python
