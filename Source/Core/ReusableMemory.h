#pragma once

#include "Core/Assert.h"
#include "Core/CountedVector.h"

#include <algorithm>
#include <cstddef>
#include <exception>
#include <limits>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

namespace palpate {

/// Memory that holds elements of one type at a time. A computation reuses it for another type when
/// it no longer needs the elements that are there.
///
/// start() ends the lifetime of all elements and begins that of others in the same bytes. Spans
/// that start() returned before must not be used afterwards.
class ReusableMemory {
 public:
  static constexpr std::size_t kAlignment = 64;

  ReusableMemory() = default;
  ReusableMemory(const ReusableMemory&) = delete;
  ReusableMemory& operator=(const ReusableMemory&) = delete;

  ~ReusableMemory() { release(); }

  std::size_t bytes() const { return m_bytes; }
  /// Keeps the elements that start() returned last, and no more memory than they need. Returns
  /// where they are now. Without memory for a smaller copy they stay where they are.
  template <class T>
  std::span<T> shrink(std::span<T> elements) {
    PALPATE_ASSERT(elements.empty() || static_cast<void*>(elements.data()) == m_memory);
    if (elements.size_bytes() == m_bytes) return elements;
    ReusableMemory smaller;
    try {
      const std::span<T> copy = smaller.start<T>(elements.size());
      std::copy(elements.begin(), elements.end(), copy.begin());
      std::swap(m_memory, smaller.m_memory);
      std::swap(m_bytes, smaller.m_bytes);
      return copy;
    } catch (const std::exception&) {
      return elements;
    }
  }
  /// The elements that start() returned last, as so many; others behind them have indeterminate
  /// values. Empty if there is no memory for more.
  template <class T>
  std::span<T> resized(std::span<T> elements, std::size_t count) {
    PALPATE_ASSERT(static_cast<void*>(elements.data()) == m_memory);
    return count * sizeof(T) <= m_bytes ? std::span<T>(elements.data(), count) : std::span<T>();
  }
  /// All elements are lost.
  void release() {
    freeCounted(std::exchange(m_memory, nullptr), std::exchange(m_bytes, 0), kAlignment);
  }

  /// Reserves so many bytes. If the memory has to grow, all elements are lost, even if this
  /// throws.
  void reserve(std::size_t bytes) {
    if (bytes <= m_bytes) return;
    release();  // first, so that old and new memory do not exist at the same time
    m_memory = static_cast<std::byte*>(allocateCounted(bytes, kAlignment));
    m_bytes = bytes;
  }

  /// `count` elements with indeterminate values. All earlier elements are lost, even if this
  /// throws.
  template <class T>
  std::span<T> start(std::size_t count) {
    static_assert(std::is_trivially_default_constructible_v<T> &&
                  std::is_trivially_destructible_v<T> && alignof(T) <= kAlignment);
    if (count == 0) return {};
    if (count > std::numeric_limits<std::size_t>::max() / sizeof(T)) throw std::bad_alloc();
    reserve(count * sizeof(T));
    return {::new (static_cast<void*>(m_memory)) T[count], count};
  }

 private:
  std::byte* m_memory = nullptr;
  std::size_t m_bytes = 0;
};

}  // namespace palpate
