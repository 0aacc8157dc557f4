#pragma once

#include "Core/CountedVector.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <iterator>
#include <type_traits>
#include <utility>
#include <vector>

namespace palpate {

/// Leaves new elements uninitialised, so that resize() before overwriting costs nothing.
template <class T>
struct UninitializedAllocator : CountedAllocator<T> {
  UninitializedAllocator() = default;
  template <class U>
  UninitializedAllocator(const UninitializedAllocator<U>&) {}
  template <class U>
  struct rebind {
    using other = UninitializedAllocator<U>;
  };
  template <class U, class... Arguments>
  void construct(U* place, Arguments&&... arguments) {
    if constexpr (sizeof...(Arguments) == 0)
      ::new (static_cast<void*>(place)) U;
    else
      ::new (static_cast<void*>(place)) U(std::forward<Arguments>(arguments)...);
  }
};

/// A vector that is about to be overwritten. Keeps its peak capacity, so a steady frame allocates
/// nothing.
template <class T>
using Buffer = std::vector<T, UninitializedAllocator<T>>;

/// resize() for contents that are about to be overwritten. It grows by an eighth to spare where
/// std::vector would double.
template <class T>
void resizeSparingly(Buffer<T>& buffer, std::size_t size) {
  if (size > buffer.capacity()) {
    buffer.clear();
    buffer.reserve(size + size / 8);
  }
  buffer.resize(size);
}

/// The capacity for so many elements to which a cut may add some.
constexpr std::size_t withSpare(std::size_t size) { return size + size / 16; }

/// reserve() for elements that are added again and again.
template <class T>
void reserveAmortized(CountedVector<T>& vector, std::size_t size) {
  if (size > vector.capacity()) vector.reserve(size + size / 2);
}

/// Inserts ascending items into an ascending vector, which has room for them.
/// Cost     a search for each item, and one move of what is behind the first one.
template <class T, class Items, class Precedes = std::less<>>
void insertSorted(CountedVector<T>& vector, const Items& items, Precedes&& precedes = {}) {
  auto count = static_cast<std::ptrdiff_t>(vector.size());
  vector.resize(vector.size() + std::size(items));
  auto out = vector.end();
  for (auto item = std::rbegin(items); item != std::rend(items); ++item) {
    const auto end = vector.begin() + count,
               place = std::upper_bound(vector.begin(), end, *item, precedes);
    out = std::move_backward(place, end, out);
    *--out = *item;
    count = place - vector.begin();
  }
}

/// Sorts items and keeps one of each.
template <class T>
void sortUnique(CountedVector<T>& items) {
  std::sort(items.begin(), items.end());
  items.erase(std::unique(items.begin(), items.end()), items.end());
}

/// Gives back most of the memory beyond the contents. Without memory for a smaller copy it does
/// nothing.
template <class T, class Allocator>
void releaseSpare(std::vector<T, Allocator>& vector) {
  if (vector.capacity() > vector.size() + vector.size() / 8) vector.shrink_to_fit();
}

}  // namespace palpate
