#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <new>
#include <span>
#include <type_traits>

namespace palpate {

/// Memory that holds elements of one type at a time. A computation reuses it for another type when
/// it no longer needs the elements that are there.
///
/// start() ends the lifetime of all elements and begins that of others in the same bytes. Spans
/// that start() returned before must not be used afterwards.
class Arena {
 public:
  static constexpr std::size_t kAlignment = 64;

  Arena() = default;
  Arena(const Arena&) = delete;
  Arena& operator=(const Arena&) = delete;

  std::size_t bytes() const { return m_bytes; }

  /// Reserves so many bytes. If the memory has to grow, all elements are lost, even if this
  /// throws.
  void reserve(std::size_t bytes) {
    if (bytes <= m_bytes) return;
    m_bytes = 0;
    m_memory.reset();  // first, so that old and new memory do not exist at the same time
    m_memory.reset(static_cast<std::byte*>(::operator new (bytes, std::align_val_t{kAlignment})));
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
    return {::new (static_cast<void*>(m_memory.get())) T[count], count};
  }

 private:
  struct Free {
    void operator()(std::byte* memory) const {
      ::operator delete (memory, std::align_val_t{kAlignment});
    }
  };

  std::unique_ptr<std::byte, Free> m_memory;
  std::size_t m_bytes = 0;
};

}  // namespace palpate
