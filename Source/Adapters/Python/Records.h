#pragma once

#include "Python/Members.h"
#include "Fields/Contacts.h"
#include "Fields/FeaturePairs.h"
#include "Fields/Queries.h"
#include "Fields/Rows.h"
#include "Fields/Topology.h"

#include <cstring>
#include <functional>
#include <memory>

namespace palpate {

namespace python {
/// TrackedContact, without an optional member.
struct TrackedRecord {
  ContactKey key, predecessor;
  bool hasPredecessor = false;
  std::uint32_t age = 0;
  std::uint64_t userData = 0;
  ContactEnd end = ContactEnd::None;
};
}  // namespace python

template <>
struct Fields<python::TrackedRecord> {
  using T = python::TrackedRecord;
  static constexpr auto kList =
      listOf(field("key", &T::key), field("predecessor", &T::predecessor),
             field("hasPredecessor", &T::hasPredecessor), field("age", &T::age, Unit::Steps),
             field("userData", &T::userData), field("end", &T::end));
};

}  // namespace palpate

namespace palpate::python {

/// The NumPy type of a member: a number, a fixed array of numbers, or the record of a struct.
template <class T>
struct Format {
  static py::object get() {
    if constexpr (std::is_enum_v<T>)
      return Format<std::underlying_type_t<T>>::get();
    else
      return py::dtype::of<T>();
  }
};
template <>
struct Format<Eigen::Vector3d> {
  static py::object get() { return py::make_tuple(py::dtype::of<double>(), py::make_tuple(3)); }
};
template <class T, std::size_t N>
struct Format<std::array<T, N>> {
  static py::object get() { return py::make_tuple(py::dtype::of<T>(), py::make_tuple(N)); }
};

/// The dtype of a struct, with one field for each member: a numpy.record, whose fields are items
/// and attributes.
template <HasFields T>
struct Format<T> {
  static py::dtype get() {
    static PyObject* type = nullptr;
    if (type == nullptr) {
      py::list names, formats, offsets;
      const auto object = std::make_unique<T>();
      forEachMember(*object, [&](const auto& field, const auto& member) {
        names.append(snakeCase(field.name).text);
        formats.append(Format<std::remove_cvref_t<decltype(member)>>::get());
        offsets.append(reinterpret_cast<const char*>(&member) -
                       reinterpret_cast<const char*>(object.get()));
      });
      const py::module_ numpy = py::module_::import("numpy");
      py::dict layout;
      layout["names"] = names;
      layout["formats"] = formats;
      layout["offsets"] = offsets;
      layout["itemsize"] = sizeof(T);
      const py::object fields = numpy.attr("dtype")(layout);
      type = numpy.attr("dtype")(py::make_tuple(numpy.attr("record"), fields)).release().ptr();
    }
    return py::reinterpret_borrow<py::dtype>(type);
  }
};

/// A new array of records that owns its memory.
template <HasFields T>
py::array newRecords(std::size_t count) {
  return py::array(Format<T>::get(), std::vector<py::ssize_t>{static_cast<py::ssize_t>(count)});
}
template <HasFields T>
std::span<T> recordsIn(py::array& array) {
  return {static_cast<T*>(array.mutable_data()), static_cast<std::size_t>(array.size())};
}

template <HasFields T>
py::array recordsOf(std::span<const T> records) {
  py::array array = newRecords<T>(records.size());
  if (!records.empty())
    std::memcpy(array.mutable_data(), static_cast<const void*>(records.data()),
                records.size_bytes());
  return array;
}
template <HasFields T>
py::array recordsOf(const std::vector<T>& records) {
  return recordsOf(std::span<const T>(records));
}

/// One record, which owns its memory.
template <HasFields T>
py::object recordOf(const T& record) {
  return recordsOf(std::span<const T>(&record, 1))[py::int_(0)];
}
template <HasFields T>
py::object recordOf(const std::optional<T>& record) {
  return record ? recordOf(*record) : py::none();
}

/// An array that shows records of an owner, which never change, and keeps the owner alive. It goes
/// to NumPy's own functions, because a frame makes many views: py::array allocates its shape.
template <HasFields T>
py::object viewOf(std::span<const T> records, const py::handle& owner) {
  const auto& numpy = py::detail::npy_api::get();
  const Py_intptr_t size = static_cast<Py_intptr_t>(records.size());
  static const T kNone{};  // NumPy allocates for null
  const T* first = records.empty() ? &kNone : records.data();
  auto array = py::reinterpret_steal<py::object>(numpy.PyArray_NewFromDescr_(
      numpy.PyArray_Type_, Format<T>::get().release().ptr(), 1, &size, nullptr,
      const_cast<void*>(static_cast<const void*>(first)), 0, nullptr));
  if (!array) throw py::error_already_set();
  // Steals a reference to the owner.
  if (numpy.PyArray_SetBaseObject_(array.ptr(), owner.inc_ref().ptr()) != 0)
    throw py::error_already_set();
  return array;
}

/// The structs in an array of the same records.
template <HasFields T>
std::vector<T> structsIn(const py::handle& object) {
  const auto array = py::reinterpret_borrow<py::array>(
      py::module_::import("numpy").attr("ascontiguousarray")(object, Format<T>::get()));
  std::vector<T> structs(static_cast<std::size_t>(array.size()));
  if (!structs.empty())
    std::memcpy(static_cast<void*>(structs.data()), array.data(), structs.size() * sizeof(T));
  return structs;
}

}  // namespace palpate::python
