// Counts malloc and related functions: these definitions in the executable replace those of the C
// library.
#include "AllocationCount.h"

#include <link.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}

namespace {

std::atomic<std::size_t> g_own, g_oneTbb;
std::uintptr_t g_begin, g_end;  // address range of the code of libtbb, empty until it is found

int findTbb(dl_phdr_info* library, std::size_t, void*) {
  if (!std::strstr(library->dlpi_name, "libtbb.so")) return 0;
  for (int i = 0; i < library->dlpi_phnum; ++i) {
    const auto& segment = library->dlpi_phdr[i];
    if (segment.p_type != PT_LOAD || !(segment.p_flags & PF_X)) continue;
    g_begin = library->dlpi_addr + segment.p_vaddr;
    g_end = g_begin + segment.p_memsz;
  }
  return 1;
}

void count(void* caller) {
  const auto address = reinterpret_cast<std::uintptr_t>(caller);
  auto& counter = address >= g_begin && address < g_end ? g_oneTbb : g_own;
  counter.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

extern "C" {
void* malloc(std::size_t size) {
  count(__builtin_return_address(0));
  return __libc_malloc(size);
}
void* calloc(std::size_t number, std::size_t size) {
  count(__builtin_return_address(0));
  return __libc_calloc(number, size);
}
void* realloc(void* block, std::size_t size) {
  count(__builtin_return_address(0));
  return __libc_realloc(block, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  count(__builtin_return_address(0));
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  count(__builtin_return_address(0));
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  count(__builtin_return_address(0));
  *block = __libc_memalign(alignment, size);
  return *block ? 0 : ENOMEM;
}
}

namespace palpate::benchmark {

AllocationCount allocationCount() {
  if (g_begin == 0) dl_iterate_phdr(findTbb, nullptr);
  return {g_own.load(), g_oneTbb.load()};
}

}  // namespace palpate::benchmark
