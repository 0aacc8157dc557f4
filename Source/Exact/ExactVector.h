#pragma once

#include "Exact/Exact.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <type_traits>
#include <utility>

// Vectors of integers, either of fixed width or of any size.
namespace palpate::exact {

using palpate::product;
// Products of integers of fixed width are twice as wide. Those of any size stay so.
inline Int128 product(std::int64_t a, std::int64_t b) { return Int128{a} * b; }
inline Int256 product(Int128 a, std::int64_t b) { return product(a, Int128{b}); }
inline Int512 product(const Int256& a, Int128 b) { return product(a, product(b, Int128{1})); }
inline Integer product(const Integer& a, const Integer& b) { return a * b; }

/// The type of a product.
template <class T>
using Wide = decltype(product(std::declval<T>(), std::declval<T>()));

template <class T>
using Vector = std::array<T, 3>;

template <class T>
Vector<T> operator-(const Vector<T>& a, const Vector<T>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
template <class T>
Wide<T> dot(const Vector<T>& a, const Vector<T>& b) {
  return product(a[0], b[0]) + product(a[1], b[1]) + product(a[2], b[2]);
}
template <class T>
Vector<Wide<T>> cross(const Vector<T>& a, const Vector<T>& b) {
  return {product(a[1], b[2]) - product(a[2], b[1]), product(a[2], b[0]) - product(a[0], b[2]),
          product(a[0], b[1]) - product(a[1], b[0])};
}

/// Whether volumeOf() may have this coordinate vector.
template <class T>
bool fitVolume(const Vector<T>& v) {
  if constexpr (std::is_same_v<T, std::int64_t>)
    return std::all_of(v.begin(), v.end(), [](T x) { return x >> 61 == 0 || x >> 61 == -1; });
  return true;
}

/// (u x v) . w: six times the volume of the tetrahedron of the origin and three points. Coordinates
/// of 64 bits must stay below 2^61.
template <class T>
auto volumeOf(const Vector<T>& u, const Vector<T>& v, const Vector<T>& w) {
  PALPATE_ASSERT(fitVolume(u) && fitVolume(v) && fitVolume(w));
  const Vector<Wide<T>> normal = cross(u, v);
  using Volume = decltype(product(normal[0], w[0]));  // not auto: sums of Integers are expressions
  return Volume(product(normal[0], w[0]) + product(normal[1], w[1]) + product(normal[2], w[2]));
}

inline int signOf(const Integer& a) { return sgn(a); }
inline int signOf(Int128 a) { return (a > 0) - (a < 0); }
inline int signOf(const Int256& a) { return a.sign(); }
inline int signOf(const Int512& a) { return a.sign(); }

}  // namespace palpate::exact
