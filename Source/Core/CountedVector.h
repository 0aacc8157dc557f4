#pragma once

#include <cstddef>
#include <limits>
#include <new>
#include <vector>

namespace palpate {

/// Memory that counts toward Settings::memoryLimit if an OctreeBasedCD allocates it. In all other
/// code it is like that of operator new, and counts toward nothing.
///
/// Errors   MemoryLimit; std::bad_alloc.
void* allocateCounted(std::size_t bytes, std::size_t alignment);
void freeCounted(void* memory, std::size_t bytes, std::size_t alignment) noexcept;

/// std::allocator over allocateCounted().
template <class T>
struct CountedAllocator {
  using value_type = T;

  CountedAllocator() = default;
  template <class U>
  CountedAllocator(const CountedAllocator<U>&) {}

  T* allocate(std::size_t count) {
    if (count > std::numeric_limits<std::size_t>::max() / 2 / sizeof(T)) throw std::bad_alloc();
    return static_cast<T*>(allocateCounted(count * sizeof(T), alignof(T)));
  }
  void deallocate(T* memory, std::size_t count) noexcept {
    freeCounted(memory, count * sizeof(T), alignof(T));
  }
  template <class U>
  bool operator==(const CountedAllocator<U>&) const {
    return true;
  }
};

/// The std::vector of everything that an OctreeBasedCD holds.
template <class T>
using CountedVector = std::vector<T, CountedAllocator<T>>;

}  // namespace palpate
