#include "Common/FailingAllocation.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <memory>
#include <new>

namespace palpate::testing {

namespace {

std::atomic<bool> armed{false}, anyFailed{false}, allFail{false};
std::atomic<std::size_t> allocations{0}, failing{0};
std::atomic<std::ptrdiff_t> inUse{0}, peak{0};  // since arm()

constexpr std::size_t kPlain = __STDCPP_DEFAULT_NEW_ALIGNMENT__;

#ifdef _WIN32  // where the C library does not tell the size of aligned memory
struct Block {
  void* start;
  std::size_t size;
};
Block& blockOf(void* memory) { return static_cast<Block*>(memory)[-1]; }
void* take(std::size_t size, std::size_t alignment) {
  void* const start = std::malloc(sizeof(Block) + alignment + size);
  if (!start) return nullptr;
  void* memory = static_cast<Block*>(start) + 1;
  std::size_t space = alignment + size;
  std::align(alignment, size, memory, space);
  blockOf(memory) = {start, size};
  return memory;
}
std::size_t sizeOf(void* memory) { return blockOf(memory).size; }
void give(void* memory) {
  if (memory) std::free(blockOf(memory).start);
}
#else
void* take(std::size_t size, std::size_t alignment) {
  if (alignment <= kPlain) return std::malloc(size);
  return std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}
std::size_t sizeOf(void* memory) { return malloc_usable_size(memory); }
void give(void* memory) { std::free(memory); }
#endif

bool fails() {
  if (!armed.load(std::memory_order_relaxed)) return false;
  const std::size_t n = ++allocations, first = failing;
  const bool fail = first > 0 && (n == first || (n > first && allFail));
  if (fail) anyFailed = true;
  return fail;
}

void* counted(void* memory) {
  if (!memory || !armed.load(std::memory_order_relaxed)) return memory;
  const auto size = static_cast<std::ptrdiff_t>(sizeOf(memory));
  const std::ptrdiff_t now = inUse.fetch_add(size) + size;
  for (std::ptrdiff_t most = peak; now > most && !peak.compare_exchange_weak(most, now);) {
  }
  return memory;
}

void release(void* memory) {
  if (memory && armed.load(std::memory_order_relaxed))
    inUse -= static_cast<std::ptrdiff_t>(sizeOf(memory));
  give(memory);
}

void* allocate(std::size_t size, std::size_t alignment = kPlain) {
  if (fails()) return nullptr;
  return counted(take(size > 0 ? size : 1, alignment));
}
void* allocate(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
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
