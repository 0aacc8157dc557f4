#include "Common/FailingAllocation.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <new>

namespace palpate::testing {

namespace {

std::atomic<bool> armed{false}, anyFailed{false}, allFail{false};
std::atomic<std::size_t> allocations{0}, failing{0};
std::atomic<std::ptrdiff_t> inUse{0}, peak{0};  // since arm()

bool fails() {
  if (!armed.load(std::memory_order_relaxed)) return false;
  const std::size_t n = ++allocations, first = failing;
  const bool fail = first > 0 && (n == first || (n > first && allFail));
  if (fail) anyFailed = true;
  return fail;
}

void* counted(void* memory) {
  if (!memory || !armed.load(std::memory_order_relaxed)) return memory;
  const auto size = static_cast<std::ptrdiff_t>(malloc_usable_size(memory));
  const std::ptrdiff_t now = inUse.fetch_add(size) + size;
  for (std::ptrdiff_t most = peak; now > most && !peak.compare_exchange_weak(most, now);) {
  }
  return memory;
}

void release(void* memory) {
  if (memory && armed.load(std::memory_order_relaxed))
    inUse -= static_cast<std::ptrdiff_t>(malloc_usable_size(memory));
  std::free(memory);
}

void* allocate(std::size_t size) {
  if (fails()) return nullptr;
  return counted(std::malloc(size > 0 ? size : 1));
}

void* allocate(std::size_t size, std::align_val_t alignment) {
  if (fails()) return nullptr;
  const auto step = static_cast<std::size_t>(alignment);
  return counted(
      std::aligned_alloc(step, (size + step - 1) / step * step + (size == 0 ? step : 0)));
}

void* orThrow(void* memory) {
  if (!memory) throw std::bad_alloc();
  return memory;
}

}  // namespace

void FailingAllocation::arm(std::size_t n, Failures failures) {
  armed = false;
  allocations = 0;
  failing = n;
  allFail = failures == Failures::All;
  anyFailed = false;
  inUse = peak = 0;
  armed = true;
}

void FailingAllocation::disarm() { armed = false; }
std::size_t FailingAllocation::count() { return allocations; }
bool FailingAllocation::failed() { return anyFailed; }
std::size_t FailingAllocation::peakBytes() { return static_cast<std::size_t>(peak.load()); }
std::size_t FailingAllocation::bytes() { return static_cast<std::size_t>(inUse.load()); }

}  // namespace palpate::testing

using palpate::testing::allocate;
using palpate::testing::orThrow;
using palpate::testing::release;

void* operator new(std::size_t size) { return orThrow(allocate(size)); }
void* operator new[](std::size_t size) { return orThrow(allocate(size)); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return allocate(size); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return allocate(size); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return orThrow(allocate(size, alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return orThrow(allocate(size, alignment));
}
void* operator new(std::size_t size, std::align_val_t alignment, const std::nothrow_t&) noexcept {
  return allocate(size, alignment);
}
void* operator new[](std::size_t size, std::align_val_t alignment, const std::nothrow_t&) noexcept {
  return allocate(size, alignment);
}

void operator delete(void* memory) noexcept { release(memory); }
void operator delete[](void* memory) noexcept { release(memory); }
void operator delete(void* memory, std::size_t) noexcept { release(memory); }
void operator delete[](void* memory, std::size_t) noexcept { release(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { release(memory); }
void operator delete[](void* memory, const std::nothrow_t&) noexcept { release(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }
void operator delete(void* memory, std::align_val_t, const std::nothrow_t&) noexcept {
  release(memory);
}
void operator delete[](void* memory, std::align_val_t, const std::nothrow_t&) noexcept {
  release(memory);
}
