#include "Python/Arrays.h"

#include <algorithm>
#include <utility>

namespace palpate::python {
namespace {

std::string dimensionsOf(const py::array& array) {
  return py::str(py::tuple(array.attr("shape"))).cast<std::string>();
}

[[noreturn]] void refuseShape(const py::array& array, const char* name, const std::string& wanted) {
  throw Error(
      ErrorCode::WrongPositionCount,
      std::string(name) + " has the shape " + dimensionsOf(array) + "; it must be " + wanted + ".");
}

/// Any array of numbers as C-contiguous, aligned doubles. It is the same array if it is that.
py::array doubles(const py::handle& object, const char* name) {
  py::array array = py::array::ensure(object);
  if (!array) throw py::error_already_set();
  const char kind = array.dtype().kind();
  if (kind != 'f' && kind != 'i' && kind != 'u' && kind != 'b')
    throw py::type_error(std::string(name) + " must be an array of numbers, not of " +
                         py::str(array.dtype()).cast<std::string>());
  array = py::array_t<double, py::array::c_style | py::array::forcecast |
                                  py::detail::npy_api::NPY_ARRAY_ALIGNED_>::ensure(array);
  if (!array) throw py::error_already_set();
  return array;
}

[[noreturn]] void refuseIndex(const char* name, std::size_t row, const std::string& value) {
  throw Error(ErrorCode::IndexOutOfRange,
              "Entry " + std::to_string(row) + " of " + name + " has the index " + value + ".", {},
              row);
}

template <class Integer>
void convert(const py::array& array, std::size_t width, const char* name,
             std::vector<std::uint32_t>& out) {
  const auto* numbers = static_cast<const Integer*>(array.data());
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!std::in_range<std::uint32_t>(numbers[i]))
      refuseIndex(name, i / width, std::to_string(numbers[i]));
    out[i] = static_cast<std::uint32_t>(numbers[i]);
  }
}

/// An integer of Python, or no value if it does not fit 64 bits.
bool fits(const py::handle& object, long long& value) {
  const auto integer = py::reinterpret_steal<py::object>(PyNumber_Index(object.ptr()));
  if (!integer) throw py::error_already_set();
  int overflow = 0;
  value = PyLong_AsLongLongAndOverflow(integer.ptr(), &overflow);
  if (value == -1 && PyErr_Occurred() != nullptr) throw py::error_already_set();
  return overflow == 0;
}

}  // namespace

Positions::Positions(const py::handle& object, const char* name) : m_array(doubles(object, name)) {
  const bool empty = m_array.ndim() == 1 && m_array.size() == 0;
  if (!empty && (m_array.ndim() != 2 || m_array.shape(1) != 3))
    refuseShape(m_array, name, "(n, 3)");
  m_span = {static_cast<const Eigen::Vector3d*>(m_array.data()),
            static_cast<std::size_t>(m_array.size()) / 3};
}

Eigen::Vector3d position(const py::handle& object, const char* name) {
  const py::array array = doubles(object, name);
  if (array.ndim() != 1 || array.size() != 3) refuseShape(array, name, "(3,)");
  return *static_cast<const Eigen::Vector3d*>(array.data());
}

Numbers::Numbers(const py::handle& object, const char* name) : m_array(doubles(object, name)) {
  if (m_array.ndim() > 1) refuseShape(m_array, name, "(n,)");
  m_span = {static_cast<const double*>(m_array.data()), static_cast<std::size_t>(m_array.size())};
}

IndexArray::IndexArray(const py::handle& object, std::size_t width, const char* name)
    : m_array(py::array::ensure(object)) {
  if (!m_array) throw py::error_already_set();
  const bool empty = m_array.size() == 0;
  const bool rows =
      width == 1 ? m_array.ndim() == 1
                 : m_array.ndim() == 2 && m_array.shape(1) == static_cast<py::ssize_t>(width);
  if (!rows && !(empty && m_array.ndim() == 1))
    refuseShape(m_array, name, width == 1 ? "(n,)" : "(n, " + std::to_string(width) + ")");
  if (empty) return;  // an empty list is an array of floats
  const auto count = static_cast<std::size_t>(m_array.size());
  char kind = m_array.dtype().kind();
  if (kind == 'f' && !py::isinstance<py::array>(object)) {  // 2**63 makes floats of a list
    m_array = py::module_::import("numpy").attr("array")(object, py::arg("dtype") = "O");
    kind = 'O';
  }
  if (kind == 'u' && m_array.itemsize() <= 4) {
    m_array =
        py::array_t<std::uint32_t, py::array::c_style | py::array::forcecast |
                                       py::detail::npy_api::NPY_ARRAY_ALIGNED_>::ensure(m_array);
    m_span = {static_cast<const std::uint32_t*>(m_array.data()), count};
    return;
  }
  m_converted.resize(count);
  if (kind == 'i') {
    m_array = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(m_array);
    convert<std::int64_t>(m_array, width, name, m_converted);
  } else if (kind == 'u') {
    m_array =
        py::array_t<std::uint64_t, py::array::c_style | py::array::forcecast>::ensure(m_array);
    convert<std::uint64_t>(m_array, width, name, m_converted);
  } else if (kind == 'O') {  // integers beyond 64 bits, for example
    std::size_t i = 0;
    for (const py::handle item : m_array.attr("flat")) {
      long long value = 0;
      if (!fits(item, value) || !std::in_range<std::uint32_t>(value))
        refuseIndex(name, i / width, py::str(item).cast<std::string>());
      m_converted[i++] = static_cast<std::uint32_t>(value);
    }
  } else {
    throw py::type_error(std::string(name) + " must be an array of integers, not of " +
                         py::str(m_array.dtype()).cast<std::string>());
  }
  m_span = m_converted;
}

GeometryId geometryId(const py::handle& object) {
  long long value = 0;
  if (!fits(object, value) || !std::in_range<std::uint32_t>(value))
    throw Error(ErrorCode::UnknownGeometry,
                "There is no geometry " + py::str(object).cast<std::string>() + ".");
  return GeometryId{static_cast<std::uint32_t>(value)};
}

std::uint32_t elementIndex(const py::handle& object, const char* name) {
  long long value = 0;
  if (!fits(object, value) || !std::in_range<std::uint32_t>(value))
    throw Error(ErrorCode::IndexOutOfRange,
                std::string(name) + " has the index " + py::str(object).cast<std::string>() + ".");
  return static_cast<std::uint32_t>(value);
}

py::array_t<double> copyOf(std::span<const Eigen::Vector3d> positions) {
  py::array_t<double> array = newArray<double>(positions.size(), 3);
  std::copy_n(reinterpret_cast<const double*>(positions.data()), 3 * positions.size(),
              array.mutable_data());
  return array;
}

py::array_t<double> copyOf(const Eigen::Matrix3d& rotation) {
  py::array_t<double> array = newArray<double>(3, 3);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      array.mutable_at(row, column) = rotation(row, column);
  return array;
}

py::array_t<double> copyOf(const Eigen::Vector3d& position) {
  return copyOf(std::span<const double>(position.data(), 3));
}

py::array_t<double> copyOf(std::span<const double> numbers) {
  py::array_t<double> array = newArray<double>(numbers.size());
  std::copy(numbers.begin(), numbers.end(), array.mutable_data());
  return array;
}

py::array_t<std::uint32_t> copyOf(std::span<const std::uint32_t> indices) {
  py::array_t<std::uint32_t> array = newArray<std::uint32_t>(indices.size());
  std::copy(indices.begin(), indices.end(), array.mutable_data());
  return array;
}

py::array_t<std::uint32_t> copyOf(std::span<const GeometryId> ids) {
  return copyOf(std::span(reinterpret_cast<const std::uint32_t*>(ids.data()), ids.size()));
}

py::array_t<std::uint32_t> copyOf(std::span<const ElementPair> pairs) {
  static_assert(sizeof(ElementPair) == sizeof(std::array<std::uint32_t, 2>));
  return copyOf<2>(
      {reinterpret_cast<const std::array<std::uint32_t, 2>*>(pairs.data()), pairs.size()});
}

void protect(py::array& array) {
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
}

}  // namespace palpate::python
