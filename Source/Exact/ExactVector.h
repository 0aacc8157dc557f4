#pragma once

#include "Exact/Exact.h"

#include <array>
#include <cstdint>
#include <type_traits>

// Vectors of integers, either of fixed width or of any size.
namespace palpate::exact {

/// The type of a product: 128 bits for integers of 64 bits, the same type for others.
template <class T>
using Wide = std::conditional_t<std::is_same_v<T, std::int64_t>, Int128, T>;

template <class T>
using Vector = std::array<T, 3>;

template <class T>
Vector<T> operator-(const Vector<T>& a, const Vector<T>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
template <class T>
Wide<T> dot(const Vector<T>& a, const Vector<T>& b) {
  return Wide<T>(a[0]) * b[0] + Wide<T>(a[1]) * b[1] + Wide<T>(a[2]) * b[2];
}
template <class T>
Vector<Wide<T>> cross(const Vector<T>& a, const Vector<T>& b) {
  using W = Wide<T>;
  return {W(a[1]) * b[2] - W(a[2]) * b[1], W(a[2]) * b[0] - W(a[0]) * b[2],
          W(a[0]) * b[1] - W(a[1]) * b[0]};
}

/// Products of integers of 128 bits have 256 bits.
inline Integer product(const Integer& a, const Integer& b) { return a * b; }
using palpate::product;

/// (u x v) . w: six times the volume of the tetrahedron of the origin and three points. Coordinates
/// of 64 bits must stay below 2^61.
template <class T>
auto volumeOf(const Vector<T>& u, const Vector<T>& v, const Vector<T>& w) {
  const Vector<Wide<T>> normal = cross(u, v);
  using Volume = decltype(product(normal[0], w[0]));  // not auto: sums of Integers are expressions
  return Volume(product(normal[0], w[0]) + product(normal[1], w[1]) + product(normal[2], w[2]));
}

inline int signOf(const Integer& a) { return sgn(a); }
inline int signOf(Int128 a) { return (a > 0) - (a < 0); }
inline int signOf(const Int256& a) { return a.sign(); }

}  // namespace palpate::exact
