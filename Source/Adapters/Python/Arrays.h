#pragma once

// The only header that includes pybind11.
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <palpate/Error.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::python {

namespace py = pybind11;

/// Positions of the caller, as (n, 3) doubles. An array of float64 that is C-contiguous is read
/// where it is; others are converted. Keeps the array alive.
///
/// Errors   WrongPositionCount for another shape, TypeError for what holds no numbers.
class Positions {
 public:
  Positions(const py::handle& object, const char* name);
  std::span<const Eigen::Vector3d> span() const { return m_span; }
  std::size_t size() const { return m_span.size(); }

 private:
  py::array m_array;
  std::span<const Eigen::Vector3d> m_span;
};

/// One position of the caller, of three numbers.
Eigen::Vector3d position(const py::handle& object, const char* name);

/// Numbers of the caller, as an array of n doubles; a single number is an array of one.
class Numbers {
 public:
  Numbers(const py::handle& object, const char* name);
  std::span<const double> span() const { return m_span; }

 private:
  py::array m_array;
  std::span<const double> m_span;
};

/// Indices of the caller, as (n, width) integers, or (n) if the width is 1. An array of uint32 that
/// is C-contiguous is read where it is; others are converted.
///
/// Errors   IndexOutOfRange names the row of a number that is negative or beyond 32 bits;
///          WrongPositionCount for another shape, TypeError for what holds no integers.
class IndexArray {
 public:
  IndexArray(const py::handle& object, std::size_t width, const char* name);
  std::span<const std::uint32_t> all() const { return m_span; }

 private:
  py::array m_array;
  std::vector<std::uint32_t> m_converted;
  std::span<const std::uint32_t> m_span;
};

template <std::size_t N>
class Elements : IndexArray {
 public:
  using Element = std::array<std::uint32_t, N>;
  Elements(const py::handle& object, const char* name) : IndexArray(object, N, name) {}
  std::span<const Element> span() const {
    return {reinterpret_cast<const Element*>(all().data()), all().size() / N};
  }
};
using Indices = IndexArray;

/// A geometry id of the caller.
/// Errors   UnknownGeometry for a number that is no 32-bit id, TypeError for no integer.
GeometryId geometryId(const py::handle& object);
/// A vertex or element of the caller.
/// Errors   IndexOutOfRange for a number that is negative or beyond 32 bits.
std::uint32_t elementIndex(const py::handle& object, const char* name);

/// A new array that owns its memory, of rows of `width` numbers; of single numbers if it is 0.
template <class Number>
py::array_t<Number> newArray(std::size_t rows, std::size_t width = 0) {
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(rows)};
  if (width != 0) shape.push_back(static_cast<py::ssize_t>(width));
  return py::array_t<Number>(shape);
}

inline py::bytes bytesOf(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}
/// Valid as long as the object.
inline std::span<const std::byte> bytesIn(const py::bytes& object) {
  const std::string_view bytes = object;
  return std::as_bytes(std::span(bytes.data(), bytes.size()));
}

py::array_t<double> copyOf(std::span<const Eigen::Vector3d> positions);
py::array_t<double> copyOf(const Eigen::Matrix3d& rotation);
py::array_t<double> copyOf(const Eigen::Vector3d& position);
py::array_t<double> copyOf(std::span<const double> numbers);
py::array_t<std::uint32_t> copyOf(std::span<const std::uint32_t> indices);
py::array_t<std::uint32_t> copyOf(std::span<const GeometryId> ids);
py::array_t<std::uint32_t> copyOf(std::span<const ElementPair> pairs);
template <std::size_t N>
py::array_t<std::uint32_t> copyOf(std::span<const std::array<std::uint32_t, N>> elements) {
  py::array_t<std::uint32_t> array = newArray<std::uint32_t>(elements.size(), N);
  std::copy_n(reinterpret_cast<const std::uint32_t*>(elements.data()), N * elements.size(),
              array.mutable_data());
  return array;
}
template <class T>
auto copyOf(const std::vector<T>& values) {
  return copyOf(std::span<const T>(values));
}

/// Makes an array that others share refuse to be written.
void protect(py::array& array);

}  // namespace palpate::python
