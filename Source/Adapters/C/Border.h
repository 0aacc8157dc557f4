#pragma once

#include <palpate/Error.h>
#include <palpate/Types.h>
#include <palpate/palpate_c.h>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::c {

/// An argument that only C can get wrong. Becomes PALPATE_INVALID_ARGUMENT.
struct InvalidArgument : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Keeps the exception in flight as this thread's last error. Allocates nothing.
palpate_status failed(const char* function) noexcept;

/// Runs the body of each function of the C interface that can fail. No exception leaves it.
template <class Body>
palpate_status guarded(const char* function, const Body& body) noexcept {
  try {
    body();
    return PALPATE_OK;
  } catch (...) {
    return failed(function);
  }
}

template <class T>
T& given(T* pointer, const char* name) {
  if (!pointer) throw InvalidArgument(std::string(name) + " is null.");
  return *pointer;
}

/// `count` items of the type Item at `data`. Counts of more bytes than an array can have are
/// refused, as the end of the array would not follow its start.
template <class Item, class T>
std::span<Item> arrayOf(T* data, std::size_t count, const char* name) {
  if (count > 0) given(data, name);
  if (count > PTRDIFF_MAX / sizeof(Item))
    throw Error(ErrorCode::TooLarge, std::string(name) + " has " + std::to_string(count) +
                                         " items; a program has no memory for them");
  return {reinterpret_cast<Item*>(data), count};
}
/// Copies as many bytes as fit and gives the number of all.
inline void copyBytes(const std::vector<std::byte>& from, std::uint8_t* to, std::size_t capacity,
                      std::size_t* count) {
  const std::size_t copied = std::min(from.size(), capacity);
  std::copy_n(from.begin(), copied, reinterpret_cast<std::byte*>(to));
  *count = from.size();
}
template <class T>
std::span<T> array(T* data, std::size_t count, const char* name) {
  return arrayOf<T>(data, count, name);
}

inline std::span<const Eigen::Vector3d> positions(const double* data, std::size_t count,
                                                  const char* name = "positions") {
  static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
  return arrayOf<const Eigen::Vector3d>(data, count, name);
}

inline Eigen::Vector3d vector(const double* data, const char* name) {
  given(data, name);
  return {data[0], data[1], data[2]};
}

template <std::size_t N>
std::span<const std::array<std::uint32_t, N>> elements(const std::uint32_t* data, std::size_t count,
                                                       const char* name) {
  static_assert(sizeof(std::array<std::uint32_t, N>) == N * sizeof(std::uint32_t));
  return arrayOf<const std::array<std::uint32_t, N>>(data, count, name);
}

/// Throws unless the caller's struct is that of this version. If a later version appends members,
/// this accepts the earlier sizes, too.
template <class Struct>
void requireSize(std::size_t size, const char* name) {
  if (size != sizeof(Struct))
    throw InvalidArgument("The size of " + std::string(name) + " is " + std::to_string(size) +
                          "; it must be " + std::to_string(sizeof(Struct)) + ".");
}
template <class Struct>
Struct& sized(Struct* data, const char* name) {
  requireSize<Struct>(given(data, name).size, name);
  return *data;
}

/// The enumerator with this value; they count from 0 to `last`.
template <class Enumeration>
Enumeration enumerator(int value, Enumeration last, const std::string& name) {
  if (value < 0 || value > static_cast<int>(last))
    throw InvalidArgument(name + " is " + std::to_string(value) + "; it must be in [0, " +
                          std::to_string(static_cast<int>(last)) + "].");
  return static_cast<Enumeration>(value);
}

/// Sets the defaults of a struct that begins with `size`.
template <class Struct>
palpate_status initialise(const char* function, Struct* data, std::size_t size,
                          const Struct& defaults) noexcept {
  return guarded(function, [&] {
    given(data, "the struct");
    requireSize<Struct>(size, "the struct");
    *data = defaults;
  });
}

}  // namespace palpate::c
